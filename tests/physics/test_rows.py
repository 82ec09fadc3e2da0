"""Bare pointers to rows: what is written through them arrives."""

import numba
import numpy as np
from numba.core import types
from numba.extending import overload

from pbd_gym.physics.compiling import row


def is_marked(weight, at):
    """Tell by type of the weight; written into its callers, as `is_grabbed` of the kernels is."""
    return weight is None and at[0] == 0


@overload(is_marked, inline="always")
def _is_marked(weight, at):
    if isinstance(weight, types.NoneType):
        return lambda weight, at: at[0] == 0
    return lambda weight, at: False


@numba.njit(error_model="numpy")
def add_one(table, weights, column):
    """Add one in a column of all rows; nothing reads the pointer after the write."""
    for index in range(table.shape[0]):
        at, weight = row(table, index), weights[index]
        if weights[index] > 0 and not is_marked(weight, at):
            own = at[column]
            at[column] = own + 1


def test_what_is_written_last_into_a_row_arrives():
    # numba takes a write through a pointer for dead code after an inlined overload, unless told
    table = np.zeros((2, 3))
    add_one(table, np.ones(2), 1)
    assert table.tolist() == [[0, 1, 0], [0, 1, 0]]


@numba.njit
def row_or_none(table, index):
    if table is None:
        return None
    return row(table, index)


def add(at, column):
    """Add one in a column, if there is a row; written into its callers as `note` is."""
    if at is not None:
        at[column] += 1


@overload(add, inline="always")
def _add(at, column):
    def add_one(at, column):
        at[column] += 1

    return add_one


@numba.njit
def add_if_there_is_a_row(table, rows, column):
    for index in range(len(rows)):
        add(row_or_none(table, rows[index]), column)


def test_what_is_written_into_a_row_that_may_be_none_arrives():
    table = np.zeros((2, 3))
    add_if_there_is_a_row(table, (1, 0), 2)
    assert table.tolist() == [[0, 0, 1], [0, 0, 1]]
