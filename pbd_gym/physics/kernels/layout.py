"""Where the quantities of a particle stand in its row of the scratch array.

The scratch of a tile of worlds is `(particles + 2, WIDTH)`: one row holds everything of one
particle, component after component, each LANES numbers wide. A constraint touches two or three
rows, and LLVM can prove with as many comparisons that its lane loop may be vectorised. The last
row stays zero: it stands for the missing neighbour of a chain's first and last link. The row before
it holds marks of lanes.
"""

from . import DIM, LANES

POSITION = 0
START = DIM * LANES  # position at the start of the substep
VELOCITY = 2 * DIM * LANES
# Scratch of the chain solve, in the row of a link's first particle:
DIRECTION = 3 * DIM * LANES  # unit vector along which the link is corrected
COUPLING = 4 * DIM * LANES  # off-diagonal entry that couples the link to the one before
PIVOT = COUPLING + LANES  # reciprocal pivot of the elimination
MULTIPLIER = PIVOT + LANES  # right-hand side, then the link's multiplier
SCALE = MULTIPLIER + LANES  # 1/length that turns the link into its gradient
MASS = SCALE + LANES  # inverse mass, where it differs from lane to lane
KEPT = MASS + LANES  # position that a failed solve must not touch
WIDTH = KEPT + DIM * LANES

# In the row before the last:
FAILED = 0  # 1 where a second-order solve has failed
TOO_FAST = LANES  # 1 where a control step has ended beyond the speed limit
