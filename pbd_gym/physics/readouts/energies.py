"""Energies and momenta."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pbd_gym.physics.model import Model
from pbd_gym.physics.readouts import violations
from pbd_gym.physics.tables import entries_of_joints, entries_of_links


def kinetic_energy(model: Model, v: np.ndarray) -> np.ndarray:
    """Return the kinetic energy of each world, (W,) [J]."""
    free, mass = _masses(model)
    speed = v[:, free].astype(np.float64)
    return 0.5 * np.einsum("n,wnk,wnk->w", mass, speed, speed)


def potential_energy(model: Model, x: np.ndarray) -> np.ndarray:
    """Return the potential energy of each world in gravity, (W,) [J]; 0 at the origin."""
    free, mass = _masses(model)
    return -np.einsum("n,wnk,k->w", mass, x[:, free].astype(np.float64), model.gravity)


def elastic_energy(model: Model, x: np.ndarray) -> np.ndarray:
    """Return the energy stored in all compliant constraints, (W,) [J].

    C^2 / (2 alpha) of each; rigid constraints store none, and slack ones not while they are slack.
    """
    total = np.zeros(len(x))
    for stretch, compliance in _stretches(model, x):
        soft = compliance > 0.0
        total += 0.5 * np.sum(stretch[:, soft] ** 2 / compliance[soft], axis=1)
    return total + _hinge_energy(model, x) + _shape_energy(model, x)


def _stretches(model: Model, x: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield C (W, n) and alpha (n,) of each kind with the energy C^2 / (2 alpha)."""
    links, chains, ropes = violations.link_violations(model, x), model.chains, model.ropes
    entries = entries_of_links(chains)
    yield links[:, : len(entries)], chains.compliance[entries]
    if ropes is not None:
        of_ropes = links[:, len(entries) :]
        entries = entries_of_links(ropes)
        slack = np.repeat(ropes.slack, np.diff(ropes.offsets))[entries]
        yield np.where(slack, np.maximum(of_ropes, 0.0), of_ropes), ropes.compliance[entries]
    yield violations.distance_violations(model, x), model.distances.compliance
    yield violations.bend_violations(model, x), model.bends.compliance
    if model.limits is not None:
        yield violations.limit_violations(model, x), model.limits.compliance
    if model.rods is not None:
        compliance = model.rods.compliance[entries_of_joints(model.rods)]
        yield violations.rod_violations(model, x), compliance
    if model.folds is not None:
        yield violations.fold_violations(model, x), model.folds.compliance
    if model.volumes is not None:
        yield violations.volume_violations(model, x), model.volumes.compliance
    if model.attachments is not None:
        yield violations.attachment_violations(model, x), model.attachments.compliance


def _hinge_energy(model: Model, x: np.ndarray) -> np.ndarray:
    """Return 4 (1 - cos((phi - rest)/2)) / alpha of all hinges; its derivative is the torque."""
    if model.hinges is None:
        return np.zeros(len(x))
    sine = 0.5 * violations.hinge_violations(model, x)
    # all hinges are soft; 1 - cos without the rounding of small angles
    less = sine**2 / (1.0 + np.sqrt(np.maximum(1.0 - sine**2, 0.0)))
    return np.sum(4.0 * less / model.hinges.compliance, axis=1)


def _shape_energy(model: Model, x: np.ndarray) -> np.ndarray:
    """Return k/2 sum (m_i/M) |x_i - g_i|^2 of soft bodies; M/k is what the table holds."""
    table = model.shape_matches
    if table is None:
        return np.zeros(len(x))
    inverse_mass = model.inverse_mass[table.particles]
    mass = np.where(inverse_mass > 0.0, 1.0 / np.where(inverse_mass > 0.0, inverse_mass, 1.0), 0.0)
    softness = np.repeat(table.softness, np.diff(table.offsets))
    soft = softness > 0.0
    away = violations.shape_violations(model, x)[:, soft]
    return 0.5 * np.sum(away**2 * mass[soft] / softness[soft], axis=1)


def linear_momentum(model: Model, v: np.ndarray) -> np.ndarray:
    """Return the momentum of each world, (W, dim) [kg m/s]."""
    free, mass = _masses(model)
    return np.einsum("n,wnk->wk", mass, v[:, free].astype(np.float64))


def angular_momentum(model: Model, x: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the angular momentum of each world about the origin [kg m2/s].

    (W,) counterclockwise in 2D, (W, 3) in 3D.
    """
    free, mass = _masses(model)
    r, p = x[:, free].astype(np.float64), mass[:, None] * v[:, free].astype(np.float64)
    if model.dim == 2:
        return np.sum(r[:, :, 0] * p[:, :, 1] - r[:, :, 1] * p[:, :, 0], axis=1)
    return np.sum(np.cross(r, p), axis=1)


def _masses(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Return the particles that are no pins and their masses [kg]."""
    free = np.flatnonzero(model.inverse_mass)
    return free, 1.0 / model.inverse_mass[free]
