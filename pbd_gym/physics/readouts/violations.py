"""Strains and violations of constraints, kind by kind, as the kernels define them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pbd_gym.physics.model import Model
from pbd_gym.physics.tables import Volumes, entries_of_joints

_PIN_WEIGHT = 1000.0  # as in kernels/matching.py


def link_strains(model: Model, x: np.ndarray) -> np.ndarray:
    """Return the relative change of length of each link of `Model.links`, (W, links)."""
    pairs, rest = model.links()
    return _lengths(x, pairs) / rest - 1.0


def link_violations(model: Model, x: np.ndarray) -> np.ndarray:
    """Return length - rest length of each link of `Model.links`, (W, links) [m]."""
    pairs, rest = model.links()
    return _lengths(x, pairs) - rest


def distance_strains(model: Model, x: np.ndarray) -> np.ndarray:
    """Return the relative change of each distance, (W, E)."""
    return _lengths(x, model.distances.pairs) / model.distances.rest - 1.0


def distance_violations(model: Model, x: np.ndarray) -> np.ndarray:
    """Return length - rest length of each distance, (W, E) [m]."""
    return _lengths(x, model.distances.pairs) - model.distances.rest


def bend_violations(model: Model, x: np.ndarray) -> np.ndarray:
    """Return |x_a - 2 x_b + x_c| of each bend, (W, B) [m]."""
    a, b, c = (x[:, part].astype(np.float64) for part in model.bends.triples.T)
    return np.sqrt(np.sum((a - 2.0 * b + c) ** 2, axis=2))


def limit_violations(model: Model, x: np.ndarray) -> np.ndarray:
    """Return by how much each limit is exceeded, (W, E) [m]; negative where it is too short."""
    table = model.limits
    if table is None:
        return _nothing(x)
    length = _lengths(x, table.pairs)
    return np.maximum(length - table.greatest, 0.0) + np.minimum(length - table.least, 0.0)


def limit_strains(model: Model, x: np.ndarray) -> np.ndarray:
    """Return the violation of each limit as a share of the bound that is violated, (W, E)."""
    table = model.limits
    if table is None:
        return _nothing(x)
    beyond = limit_violations(model, x)
    return beyond / np.where(beyond < 0.0, table.least, table.greatest)


def rod_violations(model: Model, x: np.ndarray) -> np.ndarray:
    """Return how far each inner particle of rods is from its rest, (W, joints) [m].

    Straight: |x_a - 2 x_b + x_c|, the spacing times the angle. Curved: the same less its size at
    rest, in 2D of its part to the left of the line from a to c.
    """
    table = model.rods
    if table is None:
        return _nothing(x)
    joints = entries_of_joints(table)
    a, b, c = (x[:, table.particles[joints + step]].astype(np.float64) for step in (-1, 0, 1))
    bend, along = a - 2.0 * b + c, c - a
    size = np.sqrt(np.sum(bend**2, axis=2))
    turned = size
    if model.dim == 2:
        left = np.stack([-along[..., 1], along[..., 0]], axis=2)
        length = np.sqrt(np.sum(along**2, axis=2))
        turned = np.sum(left * bend, axis=2) / np.where(length > 0.0, length, 1.0)
    curved = np.repeat(table.curved, np.diff(table.offsets))[joints]
    return np.where(curved, turned - table.rest[joints], size)


def hinge_violations(model: Model, x: np.ndarray) -> np.ndarray:
    """Return 2 sin((phi - rest)/2) of each hinge of angle phi, (W, H) [rad]."""
    table = model.hinges
    if table is None:
        return _nothing(x)
    a, b, c, d = np.moveaxis(x[:, table.corners].astype(np.float64), 2, 0)
    up, down = np.cross(b - a, c - a), np.cross(d - a, b - a)
    edge = (b - a) / np.sqrt(np.sum((b - a) ** 2, axis=2, keepdims=True))
    turn = np.sum(np.cross(up, down) * edge, axis=2)
    half = 0.5 * np.arctan2(turn, np.sum(up * down, axis=2))
    return 2.0 * (np.sin(half) * table.cosine - np.cos(half) * table.sine)


def fold_violations(model: Model, x: np.ndarray) -> np.ndarray:
    """Return the size of the weighted sum of each fold's corners, (W, F) [m]."""
    table = model.folds
    if table is None:
        return _nothing(x)
    corners = x[:, table.corners].astype(np.float64)
    return np.linalg.norm(np.einsum("fc,wfck->wfk", table.weights, corners), axis=2)


def volume_violations(model: Model, x: np.ndarray) -> np.ndarray:
    """Return content - rest of each area [m2] or volume [m3], (W, V)."""
    table = model.volumes
    if table is None:
        return _nothing(x)
    return _contents(table, x) - table.rest


def volume_strains(model: Model, x: np.ndarray) -> np.ndarray:
    """Return the relative change of each area or volume, (W, V)."""
    if model.volumes is None:
        return _nothing(x)
    return _contents(model.volumes, x) / model.volumes.rest - 1.0


def _contents(table: Volumes, x: np.ndarray) -> np.ndarray:
    """Return the signed area [m2] or volume [m3] of each closed outline or surface, (W, V)."""
    contents = np.zeros((len(x), len(table.rest)))
    for index, first in enumerate(table.offsets[:-1]):
        facets = table.facets[table.facet_offsets[index] : table.facet_offsets[index + 1]]
        # from one of the particles: far from the origin the terms would cancel
        corners = x[:, facets].astype(np.float64) - x[:, None, None, table.particles[first]]
        factorial = 2.0 if x.shape[2] == 2 else 6.0
        contents[:, index] = np.sum(np.linalg.det(corners), axis=1) / factorial
    return contents


def shape_violations(model: Model, x: np.ndarray) -> np.ndarray:
    """Return how far each particle of each matched body is from its place in it, (W, L) [m].

    Pins as built weigh as much as in the kernel; what is grabbed counts as free here.
    """
    table = model.shape_matches
    if table is None:
        return _nothing(x)
    away = np.zeros((len(x), len(table.particles)))
    for first, last in pairwise(table.offsets):
        points = x[:, table.particles[first:last]].astype(np.float64)
        away[:, first:last] = _away_from_shape(
            points, table.rest[first:last], table.weight[first:last]
        )
    return away


def _away_from_shape(points: np.ndarray, rest: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return the distances (W, n) of points (W, n, dim) from a shape (n, dim) laid on them."""
    weight = np.where(weight > 0.0, weight, _PIN_WEIGHT)
    weight = weight / np.sum(weight)
    p = points - np.einsum("n,wnk->wk", weight, points)[:, None]
    q = rest - weight @ rest
    # the best rotation is the orthogonal factor of the moment (Mueller et al. 2005)
    left, _, right = np.linalg.svd(np.einsum("n,wni,nj->wij", weight, p, q))
    left[:, :, -1] *= np.linalg.det(left @ right)[:, None]
    return np.linalg.norm(p - np.einsum("wij,nj->wni", left @ right, q), axis=2)


def attachment_violations(model: Model, x: np.ndarray) -> np.ndarray:
    """Return |x_particle - x_anchor - offset| of each attachment, (W, A) [m]."""
    table = model.attachments
    if table is None:
        return _nothing(x)
    a, b = (x[:, ends].astype(np.float64) for ends in table.pairs.T)
    return np.linalg.norm(a - b - table.offsets, axis=2)


def _lengths(x: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return the distance of each pair, (W, pairs) [m]."""
    delta = x[:, pairs[:, 0]].astype(np.float64) - x[:, pairs[:, 1]]
    return np.sqrt(np.sum(delta**2, axis=2))


def _nothing(x: np.ndarray) -> np.ndarray:
    """Return what is told of a kind that a model lacks."""
    return np.zeros((len(x), 0))
