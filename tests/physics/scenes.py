"""Small models for the physics tests, and the state in which they start."""

import numpy as np

from pbd_gym.physics import Model, ModelBuilder, World, shapes

GRAVITY = 9.81


def particles_2d(positions, *, mass=1.0, room=None, **settings) -> Model:
    """Free particles; room is (lower, upper, keywords of set_room)."""
    builder = ModelBuilder(2)
    builder.add_particles(positions, mass)
    if room is not None:
        lower, upper, properties = room
        builder.set_room(lower, upper, **properties)
    return builder.build(**settings)


def rope_2d(particles=8, length=1.0, *, pins=(), rope=None, **settings) -> Model:
    """A rope that hangs down from (0, 0); `rope` are keywords of shapes.rope."""
    builder = ModelBuilder(2)
    keywords = {"mass": 0.2, **(rope or {})}
    indices = shapes.rope(builder, (0.0, 0.0), (0.0, -length), particles, **keywords)
    builder.pin(indices[list(pins)])
    return builder.build(**settings)


def pendulum_2d(lengths=(1.0,), masses=(1.0,), **settings) -> Model:
    builder = ModelBuilder(2)
    shapes.pendulum(builder, (0.0, 0.0), list(lengths), list(masses))
    return builder.build(**settings)


def cloth_3d(shape=(6, 6), *, height=0.3, pins=(), ground=True, **settings) -> Model:
    """A horizontal cloth of 4 cm cells that may not pass through itself, above a table."""
    builder = ModelBuilder(3)
    rows, columns = shape
    cell = 0.04
    grid = shapes.cloth(
        builder,
        (0.0, 0.0, height),
        (cell * (rows - 1), 0.0, 0.0),
        (0.0, cell * (columns - 1), 0.0),
        shape,
        mass=0.1,
        stretch_compliance=1e-6,
        bending_compliance=0.1,
        collision_distance=0.6 * cell,
    )
    builder.pin([grid[pin] for pin in pins])
    if ground:
        builder.set_ground(0.0, friction=0.5, radius=0.004)
    settings = {"damping": 0.5, "iterations": 2, **settings}
    return builder.build(**settings)


def world(model, num_worlds=1, **keywords) -> World:
    """Worlds in double precision, so that tolerances speak of the method and not of rounding."""
    return World(model, num_worlds, **{"dtype": np.float64, "lanes": 1, **keywords})


def turn(state, angles) -> None:
    """Turn the links of one hanging pendulum to angles from the downward vertical [rad]."""
    lengths = np.linalg.norm(np.diff(state.model.positions, axis=0), axis=1)
    links = np.stack([lengths * np.sin(angles), -lengths * np.cos(angles)], axis=1)
    state.x[:, 1:] = state.x[:, :1] + np.cumsum(links, axis=0)


def strain(state) -> float:
    """Largest relative change of length of a link in any world."""
    pairs, rest = state.model.links()
    links = state.x[:, pairs[:, 0]] - state.x[:, pairs[:, 1]]
    return float(np.abs(np.linalg.norm(links, axis=2) / rest - 1.0).max())


def energy(state) -> float:
    """Kinetic and potential energy of the free particles of world 0 [J]."""
    free = state.model.inverse_mass > 0
    mass = 1.0 / state.model.inverse_mass[free]
    x, v = state.x[0, free], state.v[0, free]
    return float(np.sum(mass * (0.5 * np.sum(v * v, axis=1) - x @ state.model.gravity)))


def momenta(state) -> tuple[np.ndarray, np.ndarray]:
    """Linear [kg m/s] and angular momentum [kg m2/s] of world 0, whose particles are all free."""
    mass = 1.0 / state.model.inverse_mass[:, None]
    x, v = state.x[0], state.v[0]
    spin = mass[:, None] * (x[:, :, None] * v[:, None, :] - x[:, None, :] * v[:, :, None])
    return np.sum(mass * v, axis=0), np.sum(spin, axis=0)
