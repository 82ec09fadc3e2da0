"""Elementary functions that are exact enough, within the ranges they are documented for."""

import math

import numpy as np
import pytest

from pbd_gym.physics.portable import cos_sin, exp, exp_scalar


def test_exp_is_right_to_13_digits_down_to_minus_64():
    values = np.concatenate([np.linspace(-64.0, 0.0, 20001), -np.logspace(-300, 1.8, 2000)])
    expected = np.array([math.exp(value) for value in values])
    # the documented bound
    np.testing.assert_allclose(exp(values), expected, rtol=1e-13, atol=0.0)


def test_exp_of_0_is_exactly_1():
    assert exp(0.0) == 1.0
    assert exp(-0.0) == 1.0


@pytest.mark.parametrize("value", [-64.0, -65.0, -1e10, -np.inf])
def test_exp_below_minus_64_stays_at_its_value_there(value):
    assert exp(value) == exp(-64.0)
    assert 0.0 < exp(value) < 1e-27


def test_exp_never_exceeds_1_and_never_falls_as_its_argument_grows():
    values = np.linspace(-70.0, 0.0, 100001)
    result = exp(values)
    assert result.max() == 1.0
    # steps of 7e-4 change the result by far more than its error of 1e-13
    assert (np.diff(result) >= 0.0).all()


def test_cosine_and_sine_are_right_to_14_decimals_over_the_circle():
    angles = np.concatenate([np.linspace(-math.pi, math.pi, 20001), np.logspace(-300, 0.4, 2000)])
    cosine, sine = cos_sin(angles)
    # the documented bound
    np.testing.assert_allclose(cosine, [math.cos(a) for a in angles], rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(sine, [math.sin(a) for a in angles], rtol=0.0, atol=1e-14)


def test_cosine_and_sine_are_exact_at_0_and_symmetric():
    assert cos_sin(0.0) == (1.0, 0.0)
    angles = np.linspace(0.0, math.pi, 1001)
    (cosine, sine), (mirrored, turned) = cos_sin(angles), cos_sin(-angles)
    np.testing.assert_array_equal(cosine, mirrored)
    np.testing.assert_array_equal(sine, -turned)


@pytest.mark.parametrize("shape", [(), (0,), (3,), (2, 3), (2, 0, 3)])
def test_the_shape_is_kept_and_the_type_is_float64(shape):
    values = np.full(shape, -0.5, dtype=np.float32)
    for result in (exp(values), *cos_sin(values)):
        assert np.shape(result) == shape
        assert np.asarray(result).dtype == np.float64


def test_the_argument_is_left_alone_whatever_its_layout():
    values = -np.arange(12.0).reshape(3, 4).T
    before = values.copy()
    result = exp(values)
    cos_sin(values / 12.0)
    np.testing.assert_array_equal(values, before)
    np.testing.assert_array_equal(result, exp(np.ascontiguousarray(values)))


def test_each_number_gives_the_same_bits_alone_and_among_many():
    values = -np.random.default_rng(0).uniform(0.0, 3.0, 101)
    np.testing.assert_array_equal(exp(values), [exp(value) for value in values])
    np.testing.assert_array_equal(exp(values), [exp_scalar(value) for value in values])
    for many, alone in zip(cos_sin(values), zip(*map(cos_sin, values), strict=True), strict=True):
        np.testing.assert_array_equal(many, alone)
