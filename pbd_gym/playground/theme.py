"""How the window looks: fonts, colours and the theme of its controls."""

from __future__ import annotations

from functools import lru_cache
from importlib.resources import files
from typing import Any

import pygame

from pbd_gym.rendering.palette import Colour

PAPER: Colour = (251, 250, 247)
SIDE: Colour = (244, 244, 241)
LINE: Colour = (214, 218, 222)
INK: Colour = (52, 59, 71)
FAINT: Colour = (104, 114, 127)
FIRST_ORDER: Colour = (209, 112, 0)  # curves of the two integrators
SECOND_ORDER: Colour = (0, 114, 178)
MARK: Colour = (184, 92, 0)  # what the mouse is about


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


def controls_theme() -> dict[str, Any]:
    """Return the theme of the controls, for pygame_gui."""
    flat = {"border_width": "1", "shadow_width": "0"}
    rounded = {**flat, "shape": "rounded_rectangle", "shape_corner_radius": "5"}
    colours = {
        "normal_bg": "#ffffff",
        "hovered_bg": "#e6f0f6",
        "selected_bg": "#0072b2",
        "active_bg": "#0072b2",
        "disabled_bg": "#f0f0ee",
        "dark_bg": _hex(SIDE),
        "normal_text": _hex(INK),
        "hovered_text": _hex(INK),
        "selected_text": "#ffffff",
        "active_text": "#ffffff",
        "disabled_text": "#a0a6ae",
        "normal_border": "#c6ccd3",
        "hovered_border": "#8fb9d3",
        "selected_border": "#00598c",
        "active_border": "#00598c",
        "disabled_border": "#dddfe2",
        "filled_bar": "#0072b2",
        "unfilled_bar": "#d6dade",
    }
    knob = {**rounded, "shape_corner_radius": "7"}
    knob_colours = {"normal_bg": "#0072b2", "hovered_bg": "#1a8fd0", "normal_border": "#00598c"}
    slider = {"enable_arrow_buttons": "0", "sliding_button_width": "16", **rounded}
    return {
        "defaults": {"colours": colours, "font": {"name": "noto_sans", "size": "14"}},
        "button": {"misc": rounded},
        "label": {"misc": {"text_horiz_alignment": "left", "text_horiz_alignment_padding": "0"}},
        "#value": {"misc": {"text_horiz_alignment": "right", "text_horiz_alignment_padding": "0"}},
        "horizontal_slider": {"colours": {"dark_bg": "#e2e5e8"}, "misc": slider},
        "horizontal_slider.#sliding_button": {"colours": knob_colours, "misc": knob},
        "drop_down_menu": {"misc": flat},
        "window": {"colours": {"dark_bg": _hex(PAPER)}, "misc": rounded},
    }


def _hex(colour: Colour) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)
