"""What every step keeps of each world beside its physics, compiled: a loop over worlds each."""

from __future__ import annotations

from typing import Any

import numpy as np

from pbd_gym.physics.compiling import entry


@entry
def clip_actions(actions: Any, clipped: Any, excess: Any) -> bool:
    """Clip actions to [-1, 1]; return whether all of them are finite.

    Args:
        actions: (n, size).
        clipped: (n, size), written.
        excess: (n,) by how much an action of a world was clipped at most, written.
    """
    finite = True
    for world in range(actions.shape[0]):
        most = 0.0
        for index in range(actions.shape[1]):
            action = np.float64(actions[world, index])
            finite &= abs(action) < np.inf  # not so for NaN either
            within = min(max(action, -1.0), 1.0)
            clipped[world, index] = within
            most = max(most, abs(action - within))
        excess[world] = most
    return bool(finite)


@entry
def find_diverged(x: Any, bound: float, diverged: Any) -> bool:
    """Mark the worlds of which a coordinate is beyond a bound [m] or NaN; say if there are any.

    Args:
        x: Positions (n, N, dim) [m].
        bound: Greatest size of a coordinate [m].
        diverged: (n,) bool, written.
    """
    limit = x.dtype.type(bound)
    coordinates = x.reshape((x.shape[0], x.shape[1] * x.shape[2]))  # one long loop, for vectors
    found = False
    for world in range(x.shape[0]):
        outside = 0
        for index in range(coordinates.shape[1]):
            outside += not (abs(coordinates[world, index]) < limit)
        diverged[world] = outside > 0
        found |= outside > 0
    return found


@entry
def keep_score(
    reward: Any,
    reached: Any,
    performance: Any,
    diverged: Any,
    start: Any,
    streak: Any,
    best: float,
    hold_steps: int,
    earned: Any,
    normalized: Any,
    success: Any,
) -> None:
    """Count the steps in a row at the goal and normalize the performance, for n worlds.

    Args:
        reward: (n,) of this step.
        reached: (n,) whether the goal is met.
        performance: (n,) the task's measure.
        diverged: (n,) which worlds diverged: their goal is not met.
        start: (n,) performance at the start.
        streak: (n,) steps in a row at which the goal was met, written.
        best: Greatest performance.
        hold_steps: Length of a streak that is a success.
        earned: (n,) the reward, 0 where a world diverged, written.
        normalized: (n,) performance as a share of the way from the start to the best, written.
        success: (n,) bool, written.
    """
    for world in range(reward.shape[0]):
        earned[world] = 0.0 if diverged[world] else reward[world]
        if reached[world] and not diverged[world]:
            streak[world] += 1
        else:
            streak[world] = 0
        success[world] = streak[world] >= hold_steps
        # a world that begins at its best stays defined: nothing to gain, 1 while it is held
        possible = max(best - start[world], 1e-6)
        normalized[world] = 1.0 - (best - performance[world]) / possible


@entry
def clip_observations(observations: Any, limit: float) -> None:
    """Clip observations (n, size) to [-limit, limit], in place; NaN stays."""
    most = observations.dtype.type(limit)
    for world in range(observations.shape[0]):
        for index in range(observations.shape[1]):
            value = observations[world, index]
            value = most if value > most else value
            observations[world, index] = -most if value < -most else value
