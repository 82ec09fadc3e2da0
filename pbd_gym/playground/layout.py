"""Where things are in the window."""

from __future__ import annotations

from typing import NamedTuple

import pygame

BAR = 50  # height of the bar of buttons [pixels]
COLUMN = 272  # width of the column of controls [pixels]
STATUS = 30  # height of the line of text at the bottom [pixels]
MARGIN = 16
SIZE = (1180, 760)  # of the window when it opens
LEAST = (900, 640)  # in which the controls have room

_CURVE = 128  # height of the energy curve [pixels]


class Layout(NamedTuple):
    """Parts of a window.

    Attributes:
        window: Width and height [pixels].
        view: Where the scene is.
        curve: Where the energy is.
        status: Where the line of text is.
        column: Where menus and sliders are.
    """

    window: tuple[int, int]
    view: pygame.Rect
    curve: pygame.Rect
    status: pygame.Rect
    column: pygame.Rect


def lay_out(window: tuple[int, int]) -> Layout:
    """Return the parts of a window of a size [pixels]."""
    width, height = window
    left, bottom = width - COLUMN, height - STATUS
    return Layout(
        window=window,
        view=pygame.Rect(0, BAR, left, bottom - _CURVE - BAR),
        curve=pygame.Rect(0, bottom - _CURVE, left, _CURVE),
        status=pygame.Rect(MARGIN, bottom, width - 2 * MARGIN, STATUS),
        column=pygame.Rect(left + MARGIN, MARGIN - 4, COLUMN - 2 * MARGIN, height - 2 * MARGIN),
    )
