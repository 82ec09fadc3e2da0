"""Tasks: what is controlled, observed and rewarded. Each is written once, for n worlds."""

from pbd_gym.tasks.base import Judgement, Start, Task, draw, number
from pbd_gym.tasks.batch import Batch
from pbd_gym.tasks.goals import GoalTask

__all__ = ["Batch", "GoalTask", "Judgement", "Start", "Task", "draw", "number"]
