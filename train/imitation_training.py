"""The training of train/imitate.py: plan, regulate, imitate, evaluate and save."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
import yaml
from tqdm import tqdm

from checkpoint import save_model
from config import TrainingConfig, check_at_least
from curves import LearningCurve, Point, plot_learning_curve, write_csv
from files import write_atomically
from imitation import Imitation, ImitationSettings
from interrupt import InterruptRequest
from pbd_gym.hyperparams import algorithm_arguments, algorithm_class
from pbd_gym.sb3 import make_sb3_vec_env
from pbd_gym.tasks.pendulum import Pendulum
from pendulum_model import PendulumModel
from policies import Policy
from regulator import Regulator
from rollouts import Episodes, make_batch, run_episodes
from run_directory import RunDirectory
from swing_up import SwingUpSearch, SwingUpSettings
from training import independent_seeds


class Settings(NamedTuple):
    """How to plan and how to imitate."""

    search: SwingUpSettings
    imitation: ImitationSettings

    def save(self, path: Path) -> None:
        """Write them as YAML."""
        content = {name: dataclasses.asdict(part) for name, part in self._asdict().items()}
        with write_atomically(path) as file:
            file.write(yaml.safe_dump(content, sort_keys=False).encode())


def new_settings(options: dict[str, Any]) -> tuple[TrainingConfig, Settings]:
    """Complete what the user gave with the defaults.

    The config tells what the saved model is: a PPO that could be trained on, with little noise.
    """
    options = dict(options)
    planned = _take(options, candidates="candidates", iterations="iterations")
    planned |= {"seconds": options.pop("seconds")} if "seconds" in options else {}
    imitated = _take(options, rounds="rounds", updates="updates", num_envs="worlds")
    search, imitation = SwingUpSettings(**planned), ImitationSettings(**imitated)
    units = imitation.hidden + 2
    policy = f"dict(net_arch={{'pi': [{units}, {units}], 'vf': [64, 64]}}, activation_fn=nn.SiLU, "
    policy += "log_std_init=-5.0)"
    config = TrainingConfig(
        total_timesteps=imitation.timesteps,
        num_envs=imitation.worlds,
        eval_freq=2 * imitation.steps * imitation.worlds,
        checkpoint_freq=0,
        hyperparameters={"policy": "MlpPolicy", "policy_kwargs": policy},
        **options,
    )
    return config, Settings(search, imitation)


def _take(options: dict[str, Any], **names: str) -> dict[str, Any]:
    """Take some options out and return them by the names of settings; all count something."""
    taken = {setting: options.pop(name) for name, setting in names.items() if name in options}
    for setting, value in taken.items():
        check_at_least(setting, value, 1)
    return taken


class ImitationTraining:
    """A PPO model whose policy is fitted to a regulator. Building one writes nothing.

    Attributes:
        config: Of the run.
        curve: Evaluations; its clock and its steps include the planning.
    """

    def __init__(self, config: TrainingConfig, task: Pendulum, settings: Settings) -> None:
        torch.set_num_threads(config.threads)
        torch.manual_seed(config.seed)
        self.config = config
        self.curve = LearningCurve()
        self._settings = settings
        self._seeds = independent_seeds(config.seed)
        self._random = np.random.default_rng(self._seeds["training"])
        self._model = PendulumModel(task)
        env = make_sb3_vec_env(config.env, 1, **config.env_kwargs)
        self._ppo = algorithm_class("ppo")(
            env=env,
            seed=config.seed,
            device="cpu",
            **algorithm_arguments("ppo", config.hyperparameters),
        )
        self._worlds = make_batch(config.env, config.eval_episodes, config.env_kwargs)

    @property
    def steps(self) -> int:
        """Control steps of planning and imitation so far, over all worlds."""
        return self._model.steps

    def learn(self, run: RunDirectory) -> bool:
        """Train and fill the run's folder.

        Returns:
            False when an interrupt has ended it early (what was learned is saved all the same).

        Raises:
            ValueError: If no swing-up is found.
        """
        self.curve.start_clock()
        finished, imitation = True, None
        with InterruptRequest() as self._interrupt:
            try:
                regulator = self._plan()
                imitation = Imitation(
                    self._model, regulator, self._settings.imitation, self._random
                )
                self._imitate(imitation, run)
            except KeyboardInterrupt:
                finished = False
        if imitation is not None and imitation.student is not None:
            self._save(imitation, run)
        self.curve = self.curve.stopped()
        if self.curve.evaluations:
            write_csv(run.curve_table, self.curve)
            plot_learning_curve(run.curve_picture, self.curve, title=run.path.name)
        return finished

    def _plan(self) -> Regulator:
        """Find a swing-up and return the regulator that follows it."""
        settings = self._settings.search
        with self._bar("planning", settings.iterations) as bar:

            def progress(cost: float) -> None:
                self._check()
                bar.set_postfix({"cost": f"{cost:.3g}"}, refresh=False)
                bar.update()

            search = SwingUpSearch(self._model, settings, self._random)
            regulator = Regulator(self._model, *search.best(progress))
        episodes = self._evaluate(
            lambda seen: self._model.action(
                self._model.read(seen), regulator(self._model.read(seen)).push
            )
        )
        print(f"the regulator succeeds in {episodes.successes.mean():.0%} of episodes", flush=True)
        return regulator

    def _imitate(self, imitation: Imitation, run: RunDirectory) -> None:
        """Imitate, and evaluate and save after every second round and the last."""
        settings = self._settings.imitation
        with self._bar("imitating", settings.rounds * settings.updates) as bar:

            def progress(loss: float) -> None:
                self._check()
                success = "".join(f"{x.success_rate:.2f}" for x in self.curve.evaluations[-1:])
                bar.set_postfix({"loss": f"{loss:.2g}", "success": success}, refresh=False)
                bar.update()

            while imitation.rounds < settings.rounds:
                imitation.play_round(progress)
                if imitation.rounds % 2 == 0 or imitation.rounds == settings.rounds:
                    self._save(imitation, run)
                    episodes = self._evaluate(self._act)
                    rates = episodes.returns.mean(), episodes.successes.mean()
                    point = Point(self.steps, self.curve.seconds, *map(float, rates))
                    self.curve.evaluations.append(point)

    def _bar(self, title: str, total: int) -> tqdm:
        interval = 0.2 if sys.stderr.isatty() else 10.0  # [s]; a log file gets few lines
        return tqdm(desc=title, total=total, dynamic_ncols=True, mininterval=interval)

    def _check(self) -> None:
        """Raise KeyboardInterrupt where no file is half written, if Ctrl-C has been pressed."""
        if self._interrupt.requested:
            raise KeyboardInterrupt

    def _act(self, observations: np.ndarray) -> np.ndarray:
        return self._ppo.predict(observations, deterministic=True)[0]

    def _evaluate(self, policy: Policy) -> Episodes:
        """Return the outcomes of the same episodes each time."""
        return run_episodes(self._worlds, policy, seed=self._seeds["evaluation"])

    def _save(self, imitation: Imitation, run: RunDirectory) -> None:
        """Save the student as a model of stable-baselines3."""
        if imitation.student is not None:
            imitation.student.copy_to(self._ppo.policy)
        self._ppo.num_timesteps = self.steps
        save_model(run.model, self._ppo)
