"""Where the quantities of a particle stand in its row of the scratch array.

The scratch of a tile of worlds is `(particles + 3, WIDTH)`: one row holds everything of one
particle, component after component, each LANES numbers wide. A constraint touches two or three
rows, and LLVM can prove with as many comparisons that its lane loop may be vectorised. The last
row stays zero: it stands for the missing neighbour of a chain's first and last link. The row before
it holds marks of lanes, and the one before that takes sums over the particles of a body.
"""

from . import DIM, LANES

POSITION = 0
START = DIM * LANES  # position at the start of the substep
VELOCITY = 2 * DIM * LANES
# Scratch of the chain solve, in the row of a link's first particle:
DIRECTION = 3 * DIM * LANES  # unit vector along which the link is corrected; gradient of a volume
COUPLING = 4 * DIM * LANES  # off-diagonal entry that couples the link to the one before
PIVOT = COUPLING + LANES  # reciprocal pivot of the elimination
MULTIPLIER = PIVOT + LANES  # right-hand side, then the link's multiplier
SCALE = MULTIPLIER + LANES  # 1/length that turns the link into its gradient
MASS = SCALE + LANES  # inverse mass, where it differs from lane to lane
# Scratch of contacts, in the row of the particle, when the chains are solved:
NORMAL = DIRECTION  # out of a shape or away from a link, unit vector
GAP = COUPLING  # distance from the surface, negative inside
SHARE = PIVOT  # how far along the shape the nearest point lies, in [0, 1]
KEPT = MASS + LANES  # position that a failed solve must not touch

# In the row before the last:
FAILED = 0  # 1 where a second-order solve has failed
TOO_FAST = LANES  # 1 where a control step has ended beyond the speed limit
SETTLED = 2 * LANES  # 1 where contacts between bodies have been solved
SQUARES = 3 * LANES  # sum of all speeds squared

# In the row of sums, those of an area or volume:
CONTENT = 0  # area or volume, then the multiplier
STIFFNESS = LANES  # sum of inverse mass times gradient squared
# and those of shape matching:
TOTAL = 0  # weight
CENTRE = LANES
REST_CENTRE = (1 + DIM) * LANES
MOMENT = (1 + 2 * DIM) * LANES  # A = sum of m p q^T, row after row; the rotation; 3D: K, 10 numbers
SUMS = MOMENT + (4 if DIM == 2 else 10) * LANES

WIDTH = max(KEPT + DIM * LANES, SUMS)
