"""Drawings for tests of the playground."""

from pbd_gym.playground.drawing import Drawing, Particle, Thread
from pbd_gym.playground.files import at_rest


def hanging_rope():
    """A rope that hangs still, pinned at its upper end."""
    places = [(0.01 * k, 0.3 - 0.1 * k) for k in range(6)]  # no balance upside down
    particles = [Particle(place, 0.05, pinned=not k) for k, place in enumerate(places)]
    thread = Thread(tuple(range(6)), (0.1,) * 5)
    view = ((-1.0, -1.0), (1.0, 1.0))
    return at_rest(Drawing("Test", 2, view, tuple(particles), threads=(thread,)))
