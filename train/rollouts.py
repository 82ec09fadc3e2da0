"""Episodes on the native batch: one per world, so that short ones are not counted twice."""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from intervals import Estimate, bootstrap_mean, wilson_rate
from policies import Policy


@dataclass(frozen=True)
class Episodes:
    """Outcomes of E episodes."""

    returns: np.ndarray  # (E,)
    lengths: np.ndarray  # (E,) [steps]
    successes: np.ndarray  # (E,) bool, at the last step
    performances: np.ndarray  # (E,) normalized, at the last step
    seconds: float  # wall time of all

    def summary(self) -> dict[str, Any]:
        """Return the means with their 95 % confidence intervals, ready for JSON."""
        estimates: dict[str, Estimate] = {
            "return": bootstrap_mean(self.returns),
            "success_rate": wilson_rate(self.successes),
            "normalized_performance": bootstrap_mean(self.performances),
        }
        return {
            "episodes": len(self.returns),
            **{name: dataclasses.asdict(estimate) for name, estimate in estimates.items()},
            "mean_length": float(self.lengths.mean()),
            "steps_per_second": float(self.lengths.sum() / self.seconds),
        }


def make_batch(
    env_id: str, num_envs: int, env_kwargs: dict[str, Any], render_mode: str | None = None
) -> VectorEnv:
    """Make the native batch with autoreset in the same step."""
    return gymnasium.make_vec(
        env_id,
        num_envs=num_envs,
        vectorization_mode="vector_entry_point",
        autoreset_mode=AutoresetMode.SAME_STEP,
        render_mode=render_mode,
        **env_kwargs,
    )


def run_episodes(env: VectorEnv, policy: Policy, *, seed: int) -> Episodes:
    """Run the first episode of every world, seeded with `seed + world`, to its end."""
    worlds = env.num_envs
    returns, lengths = np.zeros(worlds), np.zeros(worlds, dtype=np.int64)
    successes, performances = np.zeros(worlds, dtype=bool), np.zeros(worlds)
    running = np.ones(worlds, dtype=bool)
    observation, _ = env.reset(seed=seed)
    env.step(policy(observation))  # compiles what is not compiled yet, outside of the clock
    start = time.perf_counter()
    observation, _ = env.reset(seed=seed)
    while running.any():
        observation, reward, terminated, truncated, info = env.step(policy(observation))
        returns[running] += reward[running]
        lengths[running] += 1
        ended = running & (terminated | truncated)
        if ended.any():
            final = info["final_info"]
            successes[ended] = final["is_success"][ended]
            performances[ended] = final["normalized_performance"][ended]
            running &= ~ended
    return Episodes(returns, lengths, successes, performances, time.perf_counter() - start)


def report(summary: dict[str, Any], title: str) -> str:
    """Lay out a summary as a small table."""
    lines = [f"{title}, {summary['episodes']} episodes, 95 % confidence intervals"]
    for name in ("return", "success_rate", "normalized_performance"):
        mean, low, high = (summary[name][key] for key in ("mean", "low", "high"))
        lines.append(f"  {name.replace('_', ' '):<24}{mean:9.3f}   [{low:.3f}, {high:.3f}]")
    lines.append(f"  {'steps/s':<24}{summary['steps_per_second']:9,.0f}")
    return "\n".join(lines)
