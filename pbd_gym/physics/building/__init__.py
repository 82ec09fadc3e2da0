"""The parts of a ModelBuilder, one per kind of thing that is added."""
