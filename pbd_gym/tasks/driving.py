"""How actions move pins: bounded acceleration, braking at edges, the span of one body."""

from __future__ import annotations

from typing import Any

import numpy as np

from pbd_gym.physics.compiling import entry, kernel


@entry
def drive_pins(
    x: Any,
    v: Any,
    action: Any,
    pins: Any,
    axes: Any,
    workspace: Any,
    limits: Any,
    targets: Any,
    short: Any,
) -> None:
    """Write where the pins of n worlds are at the end of a control step.

    A pin's velocity follows the desired one with at most the maximal acceleration along each axis.
    It brakes in time to stop at the edges of the workspace: from u the way to a stop is
    u dt + u^2/(2 a), which gives the greatest speed at a distance. Two pins stay within the span of
    their body, their middle where it would have been; where they are stopped by it, the bound on
    their acceleration does not hold.

    Args:
        x: Positions (n, N, dim) [m].
        v: Velocities (n, N, dim) [m/s].
        action: (n, P * axes) in [-1, 1].
        pins: (P,) particles.
        axes: (k,) axes along which an action moves each pin.
        workspace: (2, dim) corners [m].
        limits: Control step [s], maximal speed [m/s], maximal acceleration [m/s2], span [m].
        targets: (n, P, dim) [m], written.
        short: (n,) by how much the velocities fall short of the desired ones at most, in units of
            the maximal speed, written.
    """
    dt, max_speed, acceleration = limits[0], limits[1], limits[2]
    change = acceleration * dt
    count, dim = pins.shape[0], x.shape[2]
    for world in range(x.shape[0]):
        for index in range(count):
            for axis in range(dim):
                at, speed = x[world, pins[index], axis], v[world, pins[index], axis]
                desired = _desired(action[world], axes, index, axis, max_speed)
                speed += min(max(desired - speed, -change), change)
                speed = min(speed, _braking_speed(workspace[1, axis] - at, acceleration, dt))
                speed = max(speed, -_braking_speed(at - workspace[0, axis], acceleration, dt))
                target = min(max(at + speed * dt, workspace[0, axis]), workspace[1, axis])
                targets[world, index, axis] = target
        if count == 2:
            _keep_together(targets[world], limits[3])
            _slow_down(x[world], pins, targets[world], max_speed * dt)
        short[world] = 0
        for index in range(count):
            for axis in range(dim):
                speed = (targets[world, index, axis] - x[world, pins[index], axis]) / dt
                desired = _desired(action[world], axes, index, axis, max_speed)
                short[world] = max(short[world], abs(desired - speed) / max_speed)


@kernel
def _desired(action: Any, axes: Any, index: int, axis: int, max_speed: Any) -> Any:
    """Return the desired velocity of a pin along an axis: 0 along those that no action moves."""
    for place in range(axes.shape[0]):
        if axes[place] == axis:
            return action[index * axes.shape[0] + place] * max_speed
    return max_speed * 0


@kernel
def _braking_speed(distance: Any, acceleration: Any, dt: Any) -> Any:
    """Return the greatest speed from which a pin can stop within a distance [m/s]."""
    way = max(distance, distance * 0)
    return acceleration * (np.sqrt(dt * dt + (way + way) / acceleration) - dt)


@kernel
def _keep_together(targets: Any, span: Any) -> None:
    """Draw two pins (2, dim) together to the distance that their body can span."""
    square = span * 0
    for axis in range(targets.shape[1]):
        apart = targets[1, axis] - targets[0, axis]
        square += apart * apart
    distance = np.sqrt(square)
    if distance > span:
        share = span / distance
        for axis in range(targets.shape[1]):
            middle = (targets[0, axis] + targets[1, axis]) / 2
            reach = (targets[1, axis] - targets[0, axis]) * share / 2
            targets[0, axis] = middle - reach
            targets[1, axis] = middle + reach


@kernel
def _slow_down(x: Any, pins: Any, targets: Any, longest: Any) -> None:
    """Shorten the moves of all pins alike, so that none is longer than it may be along an axis.

    Between where the pins are and where they were to go, span and workspace hold too: both are
    convex.
    """
    move = longest * 0
    for index in range(pins.shape[0]):
        for axis in range(targets.shape[1]):
            move = max(move, abs(targets[index, axis] - x[pins[index], axis]))
    if move > longest:
        for index in range(pins.shape[0]):
            for axis in range(targets.shape[1]):
                at = x[pins[index], axis]
                targets[index, axis] = at + (targets[index, axis] - at) * (longest / move)
