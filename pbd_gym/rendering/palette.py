"""The colours of all pictures, after Okabe and Ito: told apart with every colour vision."""

from __future__ import annotations

from dataclasses import dataclass

Colour = tuple[int, int, int]


@dataclass(frozen=True)
class Theme:
    """The colours of a picture.

    Attributes:
        paper: What lies behind everything in the plane.
        grid: Lines of the squared paper.
        axis: Its lines through the origin.
        ink: Writing.
        wall: Inside of walls and shapes.
        wall_edge: Their surface.
        sky: What is above the horizon in space.
        floor: Every second tile.
        floor_tile: The tiles between.
        shadow: Cast on the floor.
        shade: Opacity of a shadow that its body touches.
        body: Ropes, bobs and bodies.
        body_edge: Their edge.
        front: The side of a cloth on which rows, columns and normal are right-handed.
        back: Its other side.
        goal: Where something shall go.
        goal_edge: Its edge.
        steel: Rods.
        dark_steel: Grippers and carts.
        light_steel: Fingers, rails and shapes in space.
        gloss: Highlights.
    """

    paper: Colour
    grid: Colour
    axis: Colour
    ink: Colour
    wall: Colour
    wall_edge: Colour
    sky: Colour
    floor: Colour
    floor_tile: Colour
    shadow: Colour
    shade: float
    body: Colour
    body_edge: Colour
    front: Colour
    back: Colour
    goal: Colour
    goal_edge: Colour
    steel: Colour
    dark_steel: Colour
    light_steel: Colour
    gloss: Colour


LIGHT = Theme(
    paper=(251, 250, 247),
    grid=(234, 236, 237),
    axis=(214, 218, 222),
    ink=(92, 100, 112),
    wall=(222, 225, 228),
    wall_edge=(150, 158, 168),
    sky=(236, 240, 243),
    floor=(225, 227, 227),
    floor_tile=(239, 240, 238),
    shadow=(38, 46, 60),
    shade=0.42,
    body=(0, 114, 178),
    body_edge=(0, 66, 110),
    front=(146, 203, 242),
    back=(20, 126, 196),
    goal=(230, 139, 0),
    goal_edge=(184, 92, 0),
    steel=(104, 114, 127),
    dark_steel=(52, 59, 71),
    light_steel=(168, 177, 188),
    gloss=(251, 250, 247),
)
DARK = Theme(
    paper=(24, 28, 35),
    grid=(36, 41, 50),
    axis=(54, 61, 72),
    ink=(158, 168, 180),
    wall=(48, 54, 64),
    wall_edge=(98, 108, 122),
    sky=(30, 35, 44),
    floor=(46, 52, 62),
    floor_tile=(56, 63, 74),
    shadow=(4, 6, 10),
    shade=0.60,
    body=(72, 172, 236),
    body_edge=(20, 88, 142),
    front=(168, 216, 250),
    back=(52, 146, 214),
    goal=(240, 168, 40),
    goal_edge=(255, 200, 96),
    steel=(134, 145, 160),
    dark_steel=(176, 186, 200),
    light_steel=(104, 114, 130),
    gloss=(255, 255, 255),
)
THEMES = {"light": LIGHT, "dark": DARK}


def mix(a: Colour, b: Colour, share: float) -> Colour:
    """Return the colour that has `share` of b and the rest of a."""
    red, green, blue = (round(p + (q - p) * share) for p, q in zip(a, b, strict=True))
    return red, green, blue
