"""The colours of all pictures, after Okabe and Ito: told apart with every colour vision."""

from __future__ import annotations

Colour = tuple[int, int, int]

PAPER: Colour = (251, 250, 247)
GRID: Colour = (234, 236, 237)
AXIS: Colour = (214, 218, 222)
INK: Colour = (122, 130, 140)
WALL: Colour = (222, 225, 228)
WALL_EDGE: Colour = (150, 158, 168)

SKY: Colour = (236, 240, 243)
FLOOR: Colour = (225, 227, 227)
FLOOR_TILE: Colour = (239, 240, 238)
SHADOW: Colour = (38, 46, 60)

BLUE: Colour = (0, 114, 178)
CLOTH_BLUE: Colour = (20, 126, 196)
DARK_BLUE: Colour = (0, 66, 110)
PALE_BLUE: Colour = (146, 203, 242)
ORANGE: Colour = (230, 139, 0)
DARK_ORANGE: Colour = (184, 92, 0)
STEEL: Colour = (104, 114, 127)
DARK_STEEL: Colour = (52, 59, 71)
LIGHT_STEEL: Colour = (168, 177, 188)


def mix(a: Colour, b: Colour, share: float) -> Colour:
    """Return the colour that has `share` of b and the rest of a."""
    red, green, blue = (round(p + (q - p) * share) for p, q in zip(a, b, strict=True))
    return red, green, blue
