"""The training itself: build the model or restore it, and let it learn."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import EvalCallback
from stable_baselines3.common.logger import configure

from callbacks import (
    BestModelSaver,
    Checkpointer,
    CurveRecorder,
    EvaluationRecorder,
    ProgressBar,
)
from checkpoint import restore_model
from config import TrainingConfig
from curves import LearningCurve, plot_learning_curve, write_csv
from interrupt import InterruptRequest
from pbd_gym.hyperparams import algorithm_arguments, algorithm_class
from pbd_gym.sb3 import make_sb3_vec_env
from run_directory import RunDirectory

# What an EvalCallback must remember for a resumed training to evaluate and choose alike.
_EVALUATION_ATTRIBUTES = (
    "best_mean_reward",
    "evaluations_timesteps",
    "evaluations_results",
    "evaluations_length",
    "evaluations_successes",
)


class Training:
    """A model with its worlds, evaluations and records, new or from a checkpoint.

    Building one writes nothing, so wrong settings are found before a run's folder exists.
    """

    def __init__(self, config: TrainingConfig, checkpoint: dict[str, Any] | None = None) -> None:
        _check_device(config.device)
        torch.set_num_threads(config.threads)
        self.config = config
        seeds = independent_seeds(config.seed)
        self._evaluation_env = make_sb3_vec_env(
            config.env, config.eval_episodes, seed=seeds["evaluation"], **config.env_kwargs
        )
        self._evaluation_env.reset()
        self._checkpoint = checkpoint
        # Staggered, as rollouts of one and the same part of an episode teach PPO little.
        training_kwargs = config.env_kwargs | config.train_env_kwargs
        env = make_sb3_vec_env(config.env, config.num_envs, stagger=True, **training_kwargs)
        if checkpoint is None:
            self.curve = LearningCurve()
            self.model: BaseAlgorithm = algorithm_class(config.algo)(
                env=env,
                seed=config.seed,
                device=config.device,
                stats_window_size=max(100, config.num_envs),  # no world counts twice before others
                **algorithm_arguments(config.algo, config.hyperparameters),
            )
            env.seed(
                seeds["training"]
            )  # the model has seeded its worlds with `seed`, `seed + 1`...
        else:
            self.curve = checkpoint["curve"]
            self._evaluation_env.set_state(checkpoint["evaluation_worlds"])
            self.model = restore_model(checkpoint, config.algo, env, config.device)

    def learn(self, run: RunDirectory) -> bool:
        """Train up to the configured total and fill the run's folder.

        Returns:
            False when an interrupt has ended it early (the checkpoint is written all the same).
        """
        self.model.set_logger(configure(str(run.tensorboard), ["tensorboard"]))
        evaluation = self._evaluation_callback(run)
        with InterruptRequest() as interrupt:
            checkpointer = Checkpointer(
                run.checkpoint,
                run.model,
                self.config.checkpoint_freq,
                interrupt,
                lambda: self._records(evaluation),
            )
            self.model.learn(
                self.config.total_timesteps - self.model.num_timesteps,
                callback=[CurveRecorder(self.curve), checkpointer, evaluation, ProgressBar()],
                reset_num_timesteps=self._checkpoint is None,
                log_interval=1 if self.config.algo == "ppo" else self.config.num_envs,
            )
        self.model.logger.close()
        write_csv(run.curve_table, self.curve)
        plot_learning_curve(run.curve_picture, self.curve, title=run.path.name)
        return not checkpointer.interrupted

    def close(self) -> None:
        """Free the worlds."""
        self._evaluation_env.close()
        env = self.model.get_env()
        if env is not None:
            env.close()

    def _evaluation_callback(self, run: RunDirectory) -> EvalCallback:
        # eval_freq counts vector steps; 0 means never.
        frequency = self.config.eval_freq and max(self.config.eval_freq // self.config.num_envs, 1)
        callback = EvalCallback(
            self._evaluation_env,
            callback_on_new_best=BestModelSaver(run.best_model),
            callback_after_eval=EvaluationRecorder(self.curve),
            n_eval_episodes=self.config.eval_episodes,
            eval_freq=frequency,
            log_path=str(run.path),
            deterministic=True,
            verbose=0,
        )
        if self._checkpoint is not None:
            vars(callback).update(self._checkpoint["evaluation"])
            callback.n_calls = self.model.num_timesteps // self.config.num_envs
        return callback

    def _records(self, evaluation: EvalCallback) -> dict[str, Any]:
        return {
            "curve": self.curve.stopped(),
            "evaluation": {name: getattr(evaluation, name) for name in _EVALUATION_ATTRIBUTES},
            "evaluation_worlds": self._evaluation_env.get_state(),
        }


def independent_seeds(seed: int) -> dict[str, int]:
    """Derive seeds for the worlds of training, periodic and final evaluation from one.

    World i gets seed + i, so neighbouring seeds would share almost all their worlds.
    """
    words = np.random.SeedSequence(seed).generate_state(3)
    return dict(zip(("training", "evaluation", "final"), words.tolist(), strict=True))


def _check_device(name: str) -> None:
    try:
        kind = torch.device("cpu" if name == "auto" else name).type
    except RuntimeError as error:
        raise ValueError(f"device must be auto, cpu, cuda or such, got {name!r}") from error
    if kind == "cuda" and not torch.cuda.is_available():
        raise ValueError(f"device {name!r} was asked for, but torch finds no CUDA device")
