"""The seed's scheme beside another engine's."""

import numpy as np

from pbd_gym.physics import ModelBuilder, World

# pyPBD 2.2.2 on the chain below: distance constraints of stiffness 1, first-order velocities, 10
# substeps of one iteration at 60 Hz; positions after one second [m].
_PYPBD = [
    [0.0, 0.0],
    [-0.19579199598468278, -0.04093857875217361],
    [-0.3957190592471187, -0.03553771074249586],
    [-0.5952641382845351, -0.02118685284339082],
    [-0.7922928119392707, -0.05553363956144723],
    [-0.9890419588630722, -0.09176627998903843],
    [-1.1291551092276828, -0.23448385106879044],
]


def test_a_chain_swings_as_in_pypbd_when_its_links_are_swept_in_the_same_order():
    builder = ModelBuilder(2)
    builder.add_particles([0.0, 0.0], 1.0, pinned=True)
    for index, mass in enumerate([1.0, 0.5, 2.0, 0.25, 1.5, 0.75], start=1):
        builder.add_particles([0.2 * index, 0.0], mass)
    # pyPBD colours its constraints: links that share no particle come first
    for first in (0, 2, 4, 1, 3, 5):
        builder.add_distance(first, first + 1)
    world = World(builder.build(), dtype=np.float64)
    for _ in range(60):
        world.step(1 / 60, 10)
    # 600 substeps of six projections, each rounded to 1e-16 relative and amplified by the swing
    assert np.abs(world.x[0] - _PYPBD).max() < 1e-12
