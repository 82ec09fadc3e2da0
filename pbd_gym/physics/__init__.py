"""Position-Based Dynamics for one or thousands of worlds, usable without Gymnasium.

`ModelBuilder` collects and checks, `Model` is what does not change, `World` is what moves.
"""

from pbd_gym.physics import shapes
from pbd_gym.physics.bodies import Balls, Linkage, Mesh, Net, Polygon, Sheet, Strand
from pbd_gym.physics.builder import ModelBuilder
from pbd_gym.physics.frames import frame_targets
from pbd_gym.physics.model import Model
from pbd_gym.physics.parameters import Forces
from pbd_gym.physics.snapshot import Snapshot
from pbd_gym.physics.timestep import Adaptive
from pbd_gym.physics.world import World

__all__ = [
    "Adaptive",
    "Balls",
    "Forces",
    "Linkage",
    "Mesh",
    "Model",
    "ModelBuilder",
    "Net",
    "Polygon",
    "Sheet",
    "Snapshot",
    "Strand",
    "World",
    "frame_targets",
    "shapes",
]
