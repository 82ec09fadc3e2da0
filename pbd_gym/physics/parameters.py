"""A Model as the compiled kernels read it."""

from __future__ import annotations

from typing import Any, NamedTuple


class Parameters(NamedTuple):
    """The arrays of a `pbd_gym.physics.Model` in the state's dtype."""

    positions: Any
    inverse_mass: Any
    gravity: Any
    pins: Any
    chain_offsets: Any
    chain_particles: Any
    link_rest: Any
    link_compliance: Any
    link_greatest_length: Any
    distance_pairs: Any
    distance_rest: Any
    distance_compliance: Any
    distance_stiffness: Any
    bend_triples: Any
    bend_compliance: Any
    bend_friction: Any
    lower: Any
    upper: Any
    contact: Any  # (3,): wall radius [m], restitution, friction
    collision_particles: Any
    collision_distance: Any  # (1,) [m]
    iterations: int
