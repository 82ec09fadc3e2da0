"""The two Gymnasium faces of a task, one world or n: where episodes begin and end."""

from pbd_gym.envs.goals import PBDGoalEnv, PBDGoalVectorEnv
from pbd_gym.envs.single import PBDEnv
from pbd_gym.envs.state import EpisodeState
from pbd_gym.envs.vector import PBDVectorEnv

__all__ = ["EpisodeState", "PBDEnv", "PBDGoalEnv", "PBDGoalVectorEnv", "PBDVectorEnv"]
