"""Runs of a second of train/train.py, and whether two are the same to the last bit."""

import signal
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
sys.path.insert(0, str(Path(__file__).parents[1] / "train"))

from callbacks import ProgressBar
from episodes import assert_same
from policies import NO_HINDSIGHT

SCRIPT = Path(__file__).parents[1] / "train/train.py"
SMALL = {
    "ppo": ["n_steps:8", "batch_size:16", "n_epochs:2", "policy_kwargs:{'net_arch':[8]}"],
    "sac": ["learning_starts:40", "gradient_steps:2", "buffer_size:500", "batch_size:16"],
    "crossq": ["learning_starts:40", "gradient_steps:2", "buffer_size:500", "batch_size:16"],
}


def small_run(folder, algo="ppo", total=256, **hyperparameters):
    """Give the arguments of a run of a second: 4 worlds, evaluated and saved several times."""
    extra = [f"{name}:{value}" for name, value in hyperparameters.items()]
    options = "--num-envs 4 --eval-freq 100 --eval-episodes 3 --checkpoint-freq 64 --no-video"
    return [
        *("--algo", algo, "--log-dir", str(folder), "--total-timesteps", str(total)),
        *options.split(),
        *("--hyperparameters", *SMALL[algo], *extra),
    ]


def interrupt_after(monkeypatch, steps):
    """Press Ctrl-C once in a training, somewhere within an update."""
    shown = ProgressBar._on_rollout_end

    def press(self):
        shown(self)
        if steps <= self.model.num_timesteps < steps + 4 * 8:
            monkeypatch.setattr(ProgressBar, "_on_rollout_end", shown)
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(ProgressBar, "_on_rollout_end", press)


def assert_same_run(first, second, algorithm):
    for file in ("model.zip", "best_model.zip"):
        models = [
            algorithm.load(run / file, device="cpu", custom_objects=NO_HINDSIGHT)
            for run in (first, second)
        ]
        assert models[0].num_timesteps == models[1].num_timesteps
        assert_same(models[0].get_parameters(), models[1].get_parameters())  # and optimizers
    evaluations = [np.load(run / "evaluations.npz") for run in (first, second)]
    assert set(evaluations[0]) == {"timesteps", "results", "ep_lengths", "successes"}
    for name in evaluations[0]:
        np.testing.assert_array_equal(evaluations[0][name], evaluations[1][name])
