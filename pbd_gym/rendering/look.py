"""How pictures look: size, camera, colours and what is written into them."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pbd_gym.rendering.palette import THEMES, Theme

MIN_SIZE = 32  # [pixels]; nothing can be told apart on less
COLORS = ("material", "strain")
OVERLAYS = ("scale", "clock", "trail")


@dataclass(frozen=True)
class Viewpoint:
    """From where a model is seen; the plane is always seen from the front.

    Attributes:
        azimuth: Direction in which the camera stands, seen from the model; 0 is x, 90 is y [deg].
        elevation: Angle of that direction above the horizon, -90 to 90 [deg].
        zoom: How much larger the model appears than framed.

    Raises:
        ValueError: For a number out of range.
    """

    azimuth: float = -62.0
    elevation: float = 32.0
    zoom: float = 1.0

    def __post_init__(self) -> None:
        for name, low, high in (
            ("azimuth", -360.0, 360.0),
            ("elevation", -90.0, 90.0),
            ("zoom", 0.05, 20.0),
        ):
            value = getattr(self, name)
            if not (isinstance(value, int | float) and low <= value <= high):
                raise ValueError(f"{name} is {value!r}; allowed: {low:g} to {high:g}")


CAMERAS = {
    "default": Viewpoint(),
    "front": Viewpoint(-90.0, 10.0),
    "side": Viewpoint(0.0, 10.0),
    "top": Viewpoint(-90.0, 90.0),
}


@dataclass(frozen=True)
class Look:
    """How pictures look, checked when made.

    Attributes:
        size: Width and height [pixels], even numbers of at least 32.
        camera: "default", "front", "side", "top" or a `Viewpoint`.
        color: "material", or "strain": how much longer or shorter every link is than it shall be.
        theme: "light" or "dark".
        show: Any of "scale" (a scale bar, or the size of a tile), "clock" and "trail" (where free
            ends have been).

    Raises:
        ValueError: For anything else.
    """

    size: tuple[int, int] = (512, 512)
    camera: str | Viewpoint = "default"
    color: str = "material"
    theme: str = "light"
    show: Sequence[str] = ("scale",)

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", check_size(self.size))
        if not isinstance(self.camera, Viewpoint):
            _check_word("camera", self.camera, [*CAMERAS, "a Viewpoint"], CAMERAS)
        _check_word("color", self.color, COLORS, COLORS)
        _check_word("theme", self.theme, list(THEMES), THEMES)
        if isinstance(self.show, str) or not isinstance(self.show, Sequence):
            raise ValueError(f"show is {self.show!r}; it must be a sequence of {list(OVERLAYS)}")
        for word in self.show:
            _check_word("show", word, OVERLAYS, OVERLAYS)
        object.__setattr__(self, "show", tuple(self.show))

    @property
    def viewpoint(self) -> Viewpoint:
        """From where the model is seen."""
        return self.camera if isinstance(self.camera, Viewpoint) else CAMERAS[self.camera]

    @property
    def colours(self) -> Theme:
        """The colours of the theme."""
        return THEMES[self.theme]


def check_size(size: Any) -> tuple[int, int]:
    """Return a picture's width and height as integers.

    Raises:
        ValueError: If it is not a pair of integers, or a side is odd or too small.
    """
    try:
        width, height = (operator.index(side) for side in size)
    except (TypeError, ValueError):
        raise ValueError(f"size is {size!r}; it must be two integers, width and height") from None
    for side in (width, height):
        if side % 2 or side < MIN_SIZE:
            raise ValueError(f"size is {size!r}; sides must be even and at least {MIN_SIZE} pixels")
    return width, height


def _check_word(name: str, value: Any, named: Sequence[str], allowed: Any) -> None:
    if not (isinstance(value, str) and value in allowed):
        raise ValueError(f"{name} is {value!r}; allowed: {', '.join(named)}")
