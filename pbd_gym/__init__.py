"""Rope, cloth and pendulum control on Position-Based Dynamics, as Gymnasium environments.

Importing registers the environments by name only: numba and pygame load when one is made.
`gymnasium.make("pbd_gym:PBDRope-v0")` imports this package by itself, in any process.
"""

from typing import Any

import gymnasium

__version__ = "0.1.0"

_IDS: dict[str, tuple[int, dict[str, Any]]] = {
    "PBDPendulum-v0": (500, {"task": "pbd_gym.tasks.pendulum:Pendulum", "links": 1}),
    "PBDDoublePendulum-v0": (500, {"task": "pbd_gym.tasks.pendulum:Pendulum", "links": 2}),
    "PBDTriplePendulum-v0": (500, {"task": "pbd_gym.tasks.pendulum:Pendulum", "links": 3}),
    "PBDRope-v0": (100, {"task": "pbd_gym.tasks.rope:Rope"}),
    "PBDCloth-v0": (90, {"task": "pbd_gym.tasks.cloth:Cloth"}),
    "PBDRopeGoal-v0": (100, {"task": "pbd_gym.tasks.twins:RopeGoal"}),
    "PBDClothGoal-v0": (90, {"task": "pbd_gym.tasks.twins:ClothGoal"}),
}

for _id, (_steps, _arguments) in _IDS.items():
    if _id not in gymnasium.registry:
        _kind = "Goal" if "Goal" in _id else ""
        gymnasium.register(
            _id,
            entry_point=f"pbd_gym.envs:PBD{_kind}Env",
            vector_entry_point=f"pbd_gym.envs:PBD{_kind}VectorEnv",
            max_episode_steps=_steps,
            kwargs=_arguments,
        )
