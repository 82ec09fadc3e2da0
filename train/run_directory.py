"""Where a run keeps its files."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class RunDirectory:
    """The folder of one run, such as runs/PBDRope-v0-ppo-0."""

    path: Path

    @property
    def config(self) -> Path:
        """All settings, and the versions they ran with."""
        return self.path / "config.yml"

    @property
    def imitation(self) -> Path:
        """How train/imitate.py planned and imitated."""
        return self.path / "imitation.yml"

    @property
    def checkpoint(self) -> Path:
        """The state of the training, from which `--resume` continues exactly."""
        return self.path / "checkpoint.pkl"

    @property
    def model(self) -> Path:
        """The last model."""
        return self.path / "model.zip"

    @property
    def best_model(self) -> Path:
        """The model with the best mean return in the periodic evaluations."""
        return self.path / "best_model.zip"

    @property
    def curve_picture(self) -> Path:
        """The learning curve, drawn."""
        return self.path / "learning_curve.png"

    @property
    def curve_table(self) -> Path:
        """The learning curve, as numbers."""
        return self.path / "learning_curve.csv"

    @property
    def evaluation(self) -> Path:
        """The final evaluation over fresh episodes."""
        return self.path / "evaluation.json"

    @property
    def video(self) -> Path:
        """The final policy at work."""
        return self.path / "video.mp4"

    @property
    def tensorboard(self) -> Path:
        """Event files for TensorBoard."""
        return self.path / "tensorboard"

    @property
    def chosen_model(self) -> Path:
        """The model to use: the best one, or the last one when nothing was evaluated."""
        return self.best_model if self.best_model.exists() else self.model

    def check_free(self, overwrite: bool) -> None:
        """Raise FileExistsError unless the folder is free, or is a run that may be replaced."""
        if not self.path.exists():
            return
        if not overwrite:
            raise FileExistsError(
                f"{self.path} exists: continue it with --resume {self.path}, "
                "replace it with --overwrite, or choose another --seed or --log-dir"
            )
        if not self.config.exists():
            raise FileExistsError(f"{self.path} is no training run, so it is not overwritten")

    def check_resumable(self) -> None:
        """Raise FileNotFoundError unless the folder holds a run with a checkpoint."""
        for file in (self.config, self.checkpoint):
            if not file.exists():
                raise FileNotFoundError(f"cannot resume {self.path}: it has no {file.name}")

    def create_anew(self) -> None:
        """Remove an older run and make the empty folder."""
        if self.path.exists():
            shutil.rmtree(self.path)
        self.path.mkdir(parents=True)
