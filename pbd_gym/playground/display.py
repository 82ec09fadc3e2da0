"""What the window shows beside its controls."""

from __future__ import annotations

import pygame

from pbd_gym.playground import theme
from pbd_gym.playground.drawing import Drawing
from pbd_gym.playground.energy import draw_energies
from pbd_gym.playground.layout import Layout
from pbd_gym.playground.simulation import REMEMBERED
from pbd_gym.playground.stage import Stage
from pbd_gym.playground.tools import Pixel, Tool


def draw_stage(
    screen: pygame.Surface, layout: Layout, stage: Stage, tool: Tool, pointer: Pixel
) -> None:
    """Draw the scene, the tool at work, and the energy."""
    stage.view.show(screen, stage.simulation)
    if layout.view.collidepoint(pointer):
        screen.set_clip(layout.view)
        tool.draw(screen, stage, pointer)
        screen.set_clip(None)
    energies, shades = stage.simulation.energies, stage.view.shades
    draw_energies(screen, layout.curve, energies, REMEMBERED, shades)


def count_up(drawing: Drawing, fps: float, pace: float) -> str:
    """Return how much there is and how fast it goes.

    Args:
        drawing: What is shown.
        fps: Pictures per second.
        pace: Seconds that pass per picture.
    """
    count = len(drawing.particles)
    return f"{count} particles  ·  {fps:.0f} pictures/s  ·  {fps * pace:.2g} × real time  ·  "


def draw_waiting(
    screen: pygame.Surface, layout: Layout, pictures: int, message: str, shades: theme.Shades
) -> None:
    """Say that the physics are being prepared, or what went wrong."""
    place = layout.view.union(layout.curve)
    screen.fill(shades.paper, place)
    if message:
        return
    words = "Preparing the physics, once"
    width, height = theme.font(20).size(words)
    corner = (place.centerx - width / 2, place.centery - height / 2)
    theme.write(screen, words + "." * (pictures // 20 % 4), corner, shades.faint, 20)
