"""Models that a builder refuses."""

import numpy as np
import pytest

from pbd_gym.physics import ModelBuilder


def line(particles=4, dim=2):
    """Particles in a row, 1 m apart."""
    builder = ModelBuilder(dim)
    points = np.zeros((particles, dim))
    points[:, 0] = np.arange(particles)
    builder.add_particles(points, 1.0)
    return builder


def refused(builder, match, **settings):
    with pytest.raises(ValueError, match=match):
        builder.build(**settings)
