"""What happens around the updates: progress, learning curve, evaluations, checkpoints."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback, EvalCallback
from tqdm import tqdm

from checkpoint import save_checkpoint, save_model
from curves import LearningCurve, Point
from files import check_room
from interrupt import InterruptRequest


def recent_episodes(model: BaseAlgorithm) -> tuple[float, float]:
    """Return mean return and success rate of the last episodes, nan when none has ended."""
    returns = [episode["r"] for episode in model.ep_info_buffer or ()]
    successes = list(model.ep_success_buffer or ())
    return (
        float(np.mean(returns)) if returns else float("nan"),
        float(np.mean(successes)) if successes else float("nan"),
    )


class ProgressBar(BaseCallback):
    """One line: steps, steps/s, time left, and mean return and success of recent episodes."""

    def _on_training_start(self) -> None:
        self._bar = tqdm(
            initial=self.model.num_timesteps,
            total=self.locals["total_timesteps"],
            unit="step",
            unit_scale=True,
            dynamic_ncols=True,
            mininterval=0.2 if sys.stderr.isatty() else 10.0,  # [s]; a log file gets few lines
        )

    def _on_step(self) -> bool:
        # The last rollout goes a little beyond the total.
        self._bar.update(min(self.training_env.num_envs, self._bar.total - self._bar.n))
        return True

    def _on_rollout_end(self) -> None:
        mean_return, success_rate = recent_episodes(self.model)
        self._bar.set_postfix(
            {"return": f"{mean_return:.1f}", "success": f"{success_rate:.2f}"}, refresh=False
        )

    def _on_training_end(self) -> None:
        self._bar.close()


class CurveRecorder(BaseCallback):
    """Adds points of the exploring policy to the learning curve, about 500 over the training."""

    def __init__(self, curve: LearningCurve) -> None:
        super().__init__()
        self._curve = curve

    def _on_training_start(self) -> None:
        self._interval = self.locals["total_timesteps"] / 500
        self._curve.start_clock()

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        points, timesteps = self._curve.training, self.model.num_timesteps
        mean_return, success_rate = recent_episodes(self.model)
        if not points or timesteps - points[-1].timesteps >= self._interval:
            points.append(Point(timesteps, self._curve.seconds, mean_return, success_rate))


class EvaluationRecorder(BaseCallback):
    """Adds each evaluation of its parent `EvalCallback` to the learning curve."""

    parent: EvalCallback

    def __init__(self, curve: LearningCurve) -> None:
        super().__init__()
        self._curve = curve

    def _on_step(self) -> bool:
        self._curve.evaluations.append(
            Point(
                self.model.num_timesteps,
                self._curve.seconds,
                self.parent.last_mean_reward,
                float(np.mean(self.parent.evaluations_successes[-1])),
            )
        )
        return True


class BestModelSaver(BaseCallback):
    """Saves the model whenever its parent `EvalCallback` has found a better one."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = path

    def _on_step(self) -> bool:
        save_model(self._path, self.model)
        return True


class Checkpointer(BaseCallback):
    """Saves between two updates: now and then, at the end, and when an interrupt is requested.

    Only there are model, worlds and random generators in step, so that going on from the file is
    going on as if nothing had happened. An interrupt ends the training right after its checkpoint.
    One is saved before the first update, too: a full disk is found before hours are spent.

    Attributes:
        interrupted: Whether an interrupt has ended the training.
    """

    def __init__(
        self,
        checkpoint: Path,
        model: Path,
        frequency: int,
        interrupt: InterruptRequest,
        records: Callable[[], dict[str, Any]],
    ) -> None:
        super().__init__()
        self._checkpoint_path, self._model_path = checkpoint, model
        self._frequency, self._interrupt, self._records = frequency, interrupt, records
        self.interrupted = False

    def _on_training_start(self) -> None:
        self._save()
        check_room(self._checkpoint_path)

    def _on_rollout_start(self) -> None:
        self.interrupted = self._interrupt.requested
        steps = self.model.num_timesteps - self._saved_at
        if self.interrupted or 0 < self._frequency <= steps:
            self._save()

    def _on_step(self) -> bool:
        return not self.interrupted

    def _on_training_end(self) -> None:
        if not self.interrupted:
            self._save()

    def _save(self) -> None:
        save_checkpoint(self._checkpoint_path, self.model, **self._records())
        save_model(self._model_path, self.model)
        self._saved_at = self.model.num_timesteps
