"""How the window looks: fonts, colours and the theme of its controls."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Any

import pygame

from pbd_gym.rendering.palette import DARK, LIGHT, Colour


@dataclass(frozen=True)
class Shades:
    """The colours of the window.

    Attributes:
        paper: Behind the scene and the curves.
        side: Behind the controls.
        line: Between the parts, and the marks of the curves.
        ink: Writing.
        faint: Writing of less weight.
        first_order: Curve of the seed's integrator.
        second_order: Curve of the other one.
        mark: What the mouse is about.
        control: Buttons and menus.
        hovered: Those under the mouse.
        edge: Around them.
        groove: In which the knobs slide.
    """

    paper: Colour
    side: Colour
    line: Colour
    ink: Colour
    faint: Colour
    first_order: Colour
    second_order: Colour
    mark: Colour
    control: Colour
    hovered: Colour
    edge: Colour
    groove: Colour


SHADES = {
    "light": Shades(
        paper=LIGHT.paper,
        side=(244, 244, 241),
        line=LIGHT.axis,
        ink=LIGHT.dark_steel,
        faint=LIGHT.steel,
        first_order=(209, 112, 0),
        second_order=(0, 114, 178),
        mark=LIGHT.goal_edge,
        control=(255, 255, 255),
        hovered=(230, 240, 246),
        edge=(198, 204, 211),
        groove=(226, 229, 232),
    ),
    "dark": Shades(
        paper=DARK.paper,
        side=(32, 37, 45),
        line=DARK.axis,
        ink=(214, 220, 228),
        faint=DARK.ink,
        first_order=DARK.goal,
        second_order=DARK.body,
        mark=DARK.goal_edge,
        control=(44, 50, 60),
        hovered=(54, 70, 86),
        edge=(78, 87, 100),
        groove=(60, 68, 80),
    ),
}


@lru_cache(maxsize=8)
def font(size: int) -> pygame.font.Font:
    """Return the font of the controls, at a size [pixels]."""
    pygame.font.init()
    return pygame.font.Font(str(files("pygame_gui") / "data" / "NotoSans-Regular.ttf"), size)


def write(
    surface: pygame.Surface, words: str, place: tuple[float, float], colour: Colour, size: int = 14
) -> None:
    """Write a line of text with its left upper corner at a place [pixels]."""
    surface.blit(font(size).render(words, True, colour), place)


def controls_theme(shades: Shades) -> dict[str, Any]:
    """Return the theme of the controls, for pygame_gui."""
    flat = {"border_width": "1", "shadow_width": "0"}
    rounded = {**flat, "shape": "rounded_rectangle", "shape_corner_radius": "5"}
    ink, faint, edge = _hex(shades.ink), _hex(shades.faint), _hex(shades.edge)
    colours = {
        "normal_bg": _hex(shades.control),
        "hovered_bg": _hex(shades.hovered),
        "selected_bg": "#0072b2",
        "active_bg": "#0072b2",
        "disabled_bg": _hex(shades.side),
        "dark_bg": _hex(shades.side),
        "normal_text": ink,
        "hovered_text": ink,
        "selected_text": "#ffffff",
        "active_text": "#ffffff",
        "disabled_text": faint,
        "normal_border": edge,
        "hovered_border": "#8fb9d3",
        "selected_border": "#00598c",
        "active_border": "#00598c",
        "disabled_border": edge,
        "filled_bar": "#0072b2",
        "unfilled_bar": _hex(shades.groove),
    }
    knob = {**rounded, "shape_corner_radius": "7"}
    knob_colours = {"normal_bg": "#0072b2", "hovered_bg": "#1a8fd0", "normal_border": "#00598c"}
    slider = {"enable_arrow_buttons": "0", "sliding_button_width": "16", **rounded}
    return {
        "defaults": {"colours": colours, "font": {"name": "noto_sans", "size": "14"}},
        "button": {"misc": rounded},
        "label": {"misc": {"text_horiz_alignment": "left", "text_horiz_alignment_padding": "0"}},
        "#value": {"misc": {"text_horiz_alignment": "right", "text_horiz_alignment_padding": "0"}},
        "horizontal_slider": {"colours": {"dark_bg": _hex(shades.groove)}, "misc": slider},
        "horizontal_slider.#sliding_button": {"colours": knob_colours, "misc": knob},
        "drop_down_menu": {"misc": flat},
        "window": {"colours": {"dark_bg": _hex(shades.paper)}, "misc": rounded},
    }


def _hex(colour: Colour) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)
