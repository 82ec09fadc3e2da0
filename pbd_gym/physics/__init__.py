"""Position-Based Dynamics for one or thousands of worlds, usable without Gymnasium.

`ModelBuilder` collects and checks, `Model` is what does not change, `World` is what moves.
"""

from pbd_gym.physics import shapes
from pbd_gym.physics.bodies import Linkage, Sheet, Strand
from pbd_gym.physics.builder import ModelBuilder
from pbd_gym.physics.model import Model
from pbd_gym.physics.world import Snapshot, World

__all__ = ["Linkage", "Model", "ModelBuilder", "Sheet", "Snapshot", "Strand", "World", "shapes"]
