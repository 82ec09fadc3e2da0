"""What is compared: environments, policies and seeds, and where each leaves what it earned."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pbd_gym.hyperparams import ALGORITHMS
from policies import BASELINES
from run_directory import RunDirectory

ENVIRONMENTS = (
    "PBDPendulum-v0",
    "PBDDoublePendulum-v0",
    "PBDTriplePendulum-v0",
    "PBDRope-v0",
    "PBDCloth-v0",
)
# Where a policy is compared that is not compared everywhere: train/imitate.py plans and regulates
# pendulums alone, and CrossQ stands beside SAC where it learns faster.
COMPARED = {"imitate": ENVIRONMENTS[:3], "crossq": ("PBDRope-v0",)}
TRAINED = (*ALGORITHMS, "imitate")
POLICIES = (*BASELINES, *TRAINED)


@dataclass(frozen=True)
class Cell:
    """One environment, policy and seed."""

    env: str
    policy: str
    seed: int

    def run(self, log_dir: Path) -> RunDirectory:
        """Return the folder of its training, or of its evaluation alone."""
        return RunDirectory(log_dir / f"{self.env}-{self.policy}-{self.seed}")

    def done(self, log_dir: Path) -> bool:
        """Tell whether it has been evaluated."""
        return self.run(log_dir).evaluation.exists()
