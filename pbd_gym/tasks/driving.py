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
    count, dim = pins.shape[0], x.shape[2]
    short[:] = 0
    for index in range(count):
        for axis in range(dim):
            column = _column(axes, index, axis)
            _aim(x, v, action, pins[index], axis, column, workspace, limits, targets[:, index])
    if count == 2:
        for world in range(x.shape[0]):
            _keep_together(targets[world], limits[3])
            _slow_down(x[world], pins, targets[world], limits[1] * limits[0])
    for index in range(count):
        for axis in range(dim):
            column = _column(axes, index, axis)
            _fall_short(x, action, pins[index], axis, column, limits, targets[:, index], short)


@kernel
def _column(axes: Any, index: int, axis: int) -> int:
    """Return the place in an action that moves a pin along an axis, -1 if there is none."""
    for place in range(axes.shape[0]):
        if axes[place] == axis:
            return index * axes.shape[0] + place
    return -1


@kernel
def _aim(
    x: Any,
    v: Any,
    action: Any,
    pin: int,
    axis: int,
    column: int,
    workspace: Any,
    limits: Any,
    targets: Any,
) -> None:
    """Write the targets (n, dim) of one pin along one axis. No branch or call: vector code."""
    dt, max_speed, acceleration = limits[0], limits[1], limits[2]
    change, none = acceleration * dt, acceleration * 0
    low, high = workspace[0, axis], workspace[1, axis]
    for world in range(x.shape[0]):
        at, speed = x[world, pin, axis], v[world, pin, axis]
        desired = action[world, column] * max_speed if column >= 0 else none
        more = desired - speed
        more = more if more > -change else -change
        speed += more if more < change else change
        # the greatest speeds from which it can stop at either edge
        above, below = high - at, at - low
        above = above if above > none else none
        below = below if below > none else none
        fastest = acceleration * (np.sqrt(dt * dt + (above + above) / acceleration) - dt)
        slowest = -(acceleration * (np.sqrt(dt * dt + (below + below) / acceleration) - dt))
        speed = fastest if fastest < speed else speed
        speed = slowest if slowest > speed else speed
        target = at + speed * dt
        target = low if low > target else target
        targets[world, axis] = high if high < target else target


@kernel
def _fall_short(
    x: Any, action: Any, pin: int, axis: int, column: int, limits: Any, targets: Any, short: Any
) -> None:
    """Raise `short` (n,) to what one pin lacks of its desired velocity along one axis."""
    dt, max_speed = limits[0], limits[1]
    for world in range(x.shape[0]):
        desired = action[world, column] * max_speed if column >= 0 else max_speed * 0
        lack = abs(desired - (targets[world, axis] - x[world, pin, axis]) / dt) / max_speed
        short[world] = lack if lack > short[world] else short[world]


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
