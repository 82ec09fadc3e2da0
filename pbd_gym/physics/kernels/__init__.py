"""Position-Based Dynamics for LANES worlds side by side, after the seed thesis, chapter 5.

Every function here is compiled. A lane is one world; the innermost loop of each constraint runs
over lanes, so that LLVM turns it into vector instructions while each world keeps its exact
sequential arithmetic. DIM and LANES are constants of a compilation: this package is loaded once
per pair by `pbd_gym.physics.compiling`, which sets them before any other file is imported.
"""

DIM = 2
LANES = 1
