"""A new task in one file: a crane carries a load from A to B and leaves it there without swing.

The file defines the task, registers it, trains PPO on it for a moment and shows that it learns:

    python examples/custom_task.py
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import ClassVar

import gymnasium
import numpy as np

from pbd_gym.physics import Linkage, Model, ModelBuilder, Strand
from pbd_gym.tasks import Judgement, Start, Task, draw, number


@dataclass(frozen=True, kw_only=True)
class Crane(Task):
    """A trolley on a rail carries a heavy load on a rope; the load must come to rest at the goal.

    The action is the trolley's desired velocity. The observation is the trolley's position and
    velocity, the load's position and velocity relative to the trolley, and the goal relative to the
    trolley. The reward is 1 where the load rests at its goal. Success: within 5 cm of it and slower
    than 0.1 m/s for 15 steps in a row.
    """

    particles: int = number(8, 2, 100)
    length: float = number(1.0, 0.1, 10.0, "m")
    rope_mass: float = number(0.1, 1e-3, 10.0, "kg")
    load: float = number(10.0, 1e-2, 1e3, "kg")
    rail: float = number(1.5, 0.5, 10.0, "m")
    max_speed: float = number(1.5, 1e-3, 100.0, "m/s")
    max_acceleration: float = number(6.0, 1e-3, 1000.0, "m/s2")
    damping: float = number(0.02, 0.0, 100.0, "1/s")

    hold_steps: ClassVar[int] = 15
    action_axes: ClassVar[tuple[int, ...]] = (0,)

    def build(self) -> Model:
        """Build the hanging rope with the load as its last particle."""
        builder = ModelBuilder(2)
        at = np.zeros((self.particles, 2))
        at[:, 1] = np.linspace(0.0, -self.length, self.particles)
        rope = builder.add_particles(at[:-1], self.rope_mass / (self.particles - 1))
        load = builder.add_particles(at[-1], self.load)
        builder.pin(rope[0])
        # the links are solved together, so a load of a thousand times their mass stretches nothing
        chain = [*map(int, rope), int(load[0])]
        builder.add_chain(chain)
        builder.add_body(Strand(tuple(chain), radius=0.01))
        builder.add_body(Linkage((chain[-1],), radius=0.03))
        return builder.build(gravity=(0.0, -self.gravity), damping=self.damping, iterations=2)

    def workspace(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the ends of the rail."""
        return np.array([-self.rail, 0.0]), np.array([self.rail, 0.0])

    @property
    def rails(self) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
        """The rail of the trolley."""
        return (self.workspace(),)

    @property
    def view(self) -> tuple[np.ndarray, np.ndarray]:
        """The rail and what hangs below it."""
        return np.array([-self.rail - 0.3, -1.2 * self.length]), np.array([self.rail + 0.3, 0.2])

    def declare_draws(self):
        """Draw where the trolley starts and where the load belongs; both can be options too."""
        return {"trolley": draw(-1.0, 1.0), "goal": draw(-1.0, 1.0)}

    def start(self, quantities: dict[str, np.ndarray]) -> Start:
        """Let the load hang at rest."""
        x = np.repeat(self.model.positions[None], len(quantities["trolley"]), axis=0)
        x[:, :, 0] += quantities["trolley"]
        goal = quantities["goal"].astype(np.float32)
        return Start(x.astype(np.float32), np.zeros_like(x, dtype=np.float32), {"goal": goal})

    def observe(self, x: np.ndarray, v: np.ndarray, variables: dict[str, np.ndarray]) -> np.ndarray:
        """Return trolley, load relative to it, and goal relative to it, (W, 7)."""
        trolley, speed = x[:, 0], v[:, 0, :1]
        load, motion = x[:, -1] - trolley, v[:, -1, :1] - speed
        goal = variables["goal"] - trolley[:, :1]
        return np.concatenate([trolley[:, :1], speed, load, motion, v[:, -1, 1:], goal], axis=1)

    def judge(
        self, x: np.ndarray, v: np.ndarray, action: np.ndarray, variables: dict[str, np.ndarray]
    ) -> Judgement:
        """Judge by the load's distance from its goal, and near it by its speed."""
        goal = variables["goal"]
        place = np.concatenate([goal, np.full_like(goal, -self.length)], axis=1)
        distance = np.linalg.norm(x[:, -1].astype(np.float64) - place, axis=1)
        speed = np.linalg.norm(v[:, -1].astype(np.float64), axis=1)
        near, slow = 1.0 / (1.0 + (distance / 0.2) ** 2), 1.0 / (1.0 + (speed / 0.3) ** 2)
        reward = near * (1.0 + slow) / 2.0
        reached = (distance < self.goal_radius) & (speed < 0.1)
        return Judgement(reward, reached, -distance, {"distance": distance, "speed": speed})

    def goal(self, variables: dict[str, np.ndarray], world: int) -> np.ndarray:
        """Only the load has a goal."""
        places = np.full((self.particles, 2), np.nan)
        places[-1] = variables["goal"][world, 0], -self.length
        return places

    @property
    def goal_radius(self) -> float:
        """Within 5 cm the load is where it belongs [m]."""
        return 0.05


# As "custom_task:Crane-v0" the id works in every process that can import this file.
if "Crane-v0" not in gymnasium.registry:
    gymnasium.register(
        "Crane-v0",
        entry_point="pbd_gym.envs:PBDEnv",
        vector_entry_point="pbd_gym.envs:PBDVectorEnv",
        max_episode_steps=120,
        kwargs={"task": "custom_task:Crane"},
    )


def evaluate(model, episodes: int = 100) -> tuple[float, float]:
    """Return mean return and success rate over fresh episodes, all at once."""
    from pbd_gym.sb3 import make_sb3_vec_env

    env = make_sb3_vec_env("custom_task:Crane-v0", episodes, seed=10_000)
    observation, done, infos = env.reset(), np.zeros(episodes, dtype=bool), []
    while not done.all():  # all episodes end at the same step: nothing but the time limit ends one
        observation, _, done, infos = env.step(model.predict(observation, deterministic=True)[0])
    env.close()
    returns = [info["episode"]["r"] for info in infos]
    return float(np.mean(returns)), float(np.mean([info["is_success"] for info in infos]))


def main() -> None:
    """Train and evaluate before and after."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--steps", type=int, default=500_000, help="of training, over all worlds (%(default)s)"
    )
    parser.add_argument("--worlds", type=int, default=128, help="side by side (%(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="(%(default)s)")
    options = parser.parse_args()

    import torch
    from stable_baselines3 import PPO

    from pbd_gym.sb3 import make_sb3_vec_env

    torch.set_num_threads(1)  # small networks: more threads only wait for each other
    env = make_sb3_vec_env("custom_task:Crane-v0", options.worlds, seed=options.seed)
    model = PPO(
        "MlpPolicy", env, n_steps=64, batch_size=2048, n_epochs=5, gamma=0.98,
        learning_rate=lambda left: 2e-3 * left, policy_kwargs={"net_arch": [64, 64]},
        seed=options.seed, device="cpu",
    )  # fmt: skip
    print("untrained: return {:.1f} of 120, success rate {:.2f}".format(*evaluate(model)))
    model.learn(options.steps, progress_bar=True)
    print("trained:   return {:.1f} of 120, success rate {:.2f}".format(*evaluate(model)))
    env.close()


if __name__ == "__main__":
    main()
