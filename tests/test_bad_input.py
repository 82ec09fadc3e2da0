"""What cannot be meant is refused by an error that names it, and nothing has changed."""

import gymnasium
import numpy as np
import pytest

from episodes import (
    IDS,
    VARIANTS,
    FragileRope,
    assert_same,
    make,
    make_vec,
    nothing,
    play,
    random_actions,
)

ROPE = "PBDRope-v0"
NAN, INF = float("nan"), float("inf")


def begun(faces=make, id=ROPE, **keywords):
    """An environment without wrappers, in the midst of an episode."""
    env = faces(id, **keywords).unwrapped
    env.reset(seed=3)
    play(env, random_actions(env, 2))
    return env


def three(id=ROPE, **keywords):
    """Worlds in one batch."""
    return make_vec(id, 3, **keywords)


def refuses(env, call, error, message):
    """Assert that a call on an environment raises and changes nothing."""
    before = env.get_state()
    with pytest.raises(error, match=message):
        call(env)
    assert_same(env.get_state(), before)


ACTIONS = {
    "NaN": ([0.0, NAN], ValueError, "action 1 .*nan"),
    "infinite": ([-INF, 0.0], ValueError, "action 0 .*-inf"),
    "too long": ([0.0, 0.0, 0.0], ValueError, r"shape .*3"),
    "too short": ([0.0], ValueError, r"shape .*1"),
    "scalar": (0.0, ValueError, "shape"),
    "nested": ([[0.0, 0.0]], ValueError, "shape"),
    "empty": ([], ValueError, r"shape .*0"),
    "ragged": ([[0.0], [0.0, 1.0]], ValueError, "action|inhomogeneous"),
    "strings": (["0", "1"], TypeError, "<U1"),
    "bytes": (np.array([b"0", b"1"]), TypeError, "S1"),
    "objects": (np.array([0.0, 1.0], dtype=object), TypeError, "object"),
    "complex": (np.array([0j, 1j]), TypeError, "complex128"),
    "bool": (np.array([True, False]), TypeError, "bool"),
    "None": (None, TypeError, "object"),
    "dict": ({"x": 1.0, "y": 0.0}, TypeError, "object"),
    "dates": (np.zeros(2, dtype="datetime64[s]"), TypeError, "datetime64"),
}


@pytest.mark.parametrize("case", ACTIONS)
def test_an_action_that_is_no_vector_of_finite_numbers_is_refused(case):
    action, error, message = ACTIONS[case]
    refuses(begun(), lambda env: env.step(action), error, message)


@pytest.mark.parametrize("case", sorted(set(ACTIONS) - {"scalar", "ragged", "None", "dict"}))
def test_actions_of_a_batch_of_which_one_is_wrong_are_refused(case):
    action, error, message = ACTIONS[case]
    action = np.asarray(action)
    actions = np.stack([action, action, action])
    refuses(begun(three), lambda env: env.step(actions), error, message)


@pytest.mark.parametrize("id", IDS)
def test_the_message_tells_in_which_world_an_action_is_nan(id):
    env = begun(three, id)
    actions = np.zeros(env.action_space.shape)
    actions[2, 0] = NAN
    refuses(env, lambda env: env.step(actions), ValueError, "action 0 of world 2 is nan")


@pytest.mark.parametrize("shape", [(2,), (2, 2), (4, 2), (3, 1), (3, 2, 1), (6,), (0, 2)])
def test_actions_of_the_wrong_shape_are_refused_by_a_batch(shape):
    message = r"shape \(" + ", ".join(map(str, shape)) + r",?\).*\(3, 2\)"
    refuses(begun(three), lambda env: env.step(np.zeros(shape)), ValueError, message)


@pytest.mark.parametrize("actions", [None, "stay", [[0.0, 0.0], [0.0], [1.0, 2.0, 3.0]]])
def test_what_is_no_array_of_actions_is_refused_by_a_batch(actions):
    refuses(
        begun(three),
        lambda env: env.step(actions),
        (TypeError, ValueError),
        "object|<U4|do not form an array",
    )


@pytest.mark.parametrize("huge", [np.array([1e300, 0.0]), np.array([3e38, 0.0]), [10**30, 0]])
def test_a_huge_but_finite_action_is_clipped_like_any_other(huge):
    env, twin = begun(), begun()
    observation, *_, info = env.step(np.asarray(huge, dtype=np.float64))
    np.testing.assert_array_equal(observation, twin.step(np.array([1.0, 0.0]))[0])
    assert np.isfinite(info["action_clipped"])


@pytest.mark.parametrize("kind", [np.float64, np.float16, np.int64, np.int8, list])
def test_an_action_of_another_real_type_is_as_good(kind):
    env, twin = begun(), begun()
    action = [1, 0] if kind is list else np.array([1, 0], dtype=kind)
    assert_same(env.step(action), twin.step(np.array([1, 0], dtype=np.float32)))


KEYWORDS = {
    "unknown": (ROPE, {"colour": 3}, TypeError, "'colour'.*particles"),
    "of another task": (ROPE, {"links": 2}, TypeError, "'links'"),
    "below range": (ROPE, {"mass": 0.0}, ValueError, r"mass is 0\.0; allowed: 0\.001"),
    "above range": (ROPE, {"gravity": 1000.0}, ValueError, r"gravity is 1000\.0"),
    "negative": (ROPE, {"damping": -1.0}, ValueError, r"damping is -1\.0"),
    "zero rate": (ROPE, {"control_rate": 0.0}, ValueError, r"control_rate is 0\.0"),
    "NaN": (ROPE, {"length": NAN}, ValueError, "length is nan"),
    "infinite": (ROPE, {"max_speed": INF}, ValueError, "max_speed is inf"),
    "True": (ROPE, {"mass": True}, TypeError, "mass is True"),
    "True for a whole number": (ROPE, {"substeps": True}, TypeError, "substeps is True"),
    "string": (ROPE, {"gravity": "9.81"}, TypeError, r"gravity is '9\.81'"),
    "None": (ROPE, {"gravity": None}, TypeError, "gravity is None"),
    "list": (ROPE, {"gravity": [0.0, 9.81]}, TypeError, r"gravity is \[0\.0, 9\.81\]"),
    "complex": (ROPE, {"gravity": 1j}, TypeError, "gravity is 1j"),
    "fraction": (ROPE, {"substeps": 2.5}, TypeError, r"substeps is 2\.5"),
    "too few particles": (ROPE, {"particles": 1}, ValueError, "particles is 1"),
    "too many links": ("PBDPendulum-v0", {"links": 6}, ValueError, "links is 6"),
    "cloth of one thread": ("PBDCloth-v0", {"particles": 1}, ValueError, "particles is 1"),
    "observation": (ROPE, {"observation": "pixels"}, ValueError, "'pixels'.*'particles'"),
    "observation None": (ROPE, {"observation": None}, ValueError, "observation is None"),
    "observation list": (ROPE, {"observation": ["x"]}, ValueError, r"\['x'\]"),
    "task": (ROPE, {"task": 3}, ValueError, "task is 3"),
    "task's place": (ROPE, {"task": "pbd_gym.tasks.rope:Row"}, ValueError, "expected a Task"),
    "render mode": (ROPE, {"render_mode": "ansi"}, ValueError, "'ansi'.*rgb_array"),
}


@pytest.mark.filterwarnings("ignore:.*render_mode='ansi':UserWarning")  # Gymnasium's own
@pytest.mark.parametrize("faces", [make, three])
@pytest.mark.parametrize("case", KEYWORDS)
def test_a_keyword_that_cannot_be_meant_is_refused(case, faces):
    id, keywords, error, message = KEYWORDS[case]
    with pytest.raises(error, match=message):
        faces(id, **keywords)


@pytest.mark.parametrize("faces", [make, three])
@pytest.mark.parametrize("size", [(0, 0), (31, 64), (64.5, 64), (64,), "large", None, (-64, 64)])
def test_a_picture_of_no_size_is_refused_at_once(faces, size):
    with pytest.raises((TypeError, ValueError), match="size"):
        faces(ROPE, render_mode="rgb_array", render_size=size)


OPTIONS = {
    "unknown": ({"color": 1}, "unknown reset option 'color'; allowed: gripper, goal"),
    "out of range": ({"goal": [0.0, 5.0]}, r"'goal' is \[0\.0, 5\.0\]; allowed"),
    "NaN": ({"goal": [NAN, 0.0]}, "'goal' is .*nan"),
    "infinite": ({"gripper": [INF, 0.0]}, "'gripper' is .*inf"),
    "too long": ({"goal": [0.0, 0.0, 0.0]}, "'goal' .*expected 2 numbers"),
    "too short": ({"goal": [0.0]}, "'goal' .*expected 2 numbers"),
    "one number for two": ({"goal": 0.0}, "'goal' .*expected 2 numbers"),
    "ragged": ({"goal": [[0.0], [0.0, 0.0]]}, "'goal' .*expected 2 numbers"),
    "string": ({"goal": "left"}, "'goal' is 'left'.*expected 2 numbers"),
    "strings": ({"goal": ["0.0", "0.0"]}, "'goal' .*expected 2 numbers"),
    "bools": ({"goal": [False, True]}, "'goal' .*expected 2 numbers"),
    "None": ({"goal": None}, "'goal' is None.*expected 2 numbers"),
    "complex": ({"goal": [0j, 0j]}, "'goal' .*expected 2 numbers"),
    "a good one first": ({"gripper": [0.0, 0.0], "goal": [9.0, 0.0]}, "'goal' is"),
    "too many rows": ({"goal": np.zeros((4, 2))}, "(?s)'goal' .*expected 2 numbers"),
}


@pytest.mark.parametrize("seed", [None, 7])
@pytest.mark.parametrize("faces", [make, three])
@pytest.mark.parametrize("case", OPTIONS)
def test_an_option_that_cannot_be_meant_is_refused(case, faces, seed):
    options, message = OPTIONS[case]
    refuses(begun(faces), lambda env: env.reset(seed=seed, options=options), ValueError, message)


@pytest.mark.parametrize(
    "rows", [np.zeros((2, 2)), np.zeros((3, 1)), np.zeros((1, 2)), np.zeros((3, 2, 1))]
)
def test_rows_of_an_option_that_do_not_fit_the_worlds_are_refused(rows):
    env = begun(three)
    refuses(env, lambda env: env.reset(options={"goal": rows}), ValueError, "(?s)'goal'.*of 3")


@pytest.mark.parametrize("faces", [make, three])
@pytest.mark.parametrize("options", [[("goal", 1)], "goal", 3])
def test_options_that_are_no_dict_are_refused(faces, options):
    env = begun(faces)
    refuses(env, lambda env: env.reset(options=options), TypeError, "options")


@pytest.mark.parametrize("faces", [make, three])
@pytest.mark.parametrize("id", VARIANTS)
def test_a_step_before_the_first_reset_is_refused(id, faces):
    env = faces(id).unwrapped
    refuses(env, lambda env: env.step(nothing(env)), RuntimeError, r"call reset\(\) first")


def test_a_step_before_every_world_was_reset_is_refused():
    env = three().unwrapped
    env.reset(options={"reset_mask": np.array([True, False, True])})
    refuses(env, lambda env: env.step(nothing(env)), RuntimeError, r"call reset\(\) first")


SEEDS = {
    "too few": ([1, 2], ValueError, "2 seeds .* 3 worlds"),
    "too many": ([1, 2, 3, 4], ValueError, "4 seeds .* 3 worlds"),
    "none": ([], ValueError, "0 seeds .* 3 worlds"),
    "negative": ([1, 2, -3], gymnasium.error.Error, "-3"),
    "negative int": (-1, gymnasium.error.Error, "-1"),
    "string": ("abc", TypeError, "seed is 'abc'"),
    "fraction": (1.5, TypeError, r"seed is 1\.5"),
    "numpy's": (np.int64(5), TypeError, "seed is .*5"),
    "fractions": ([1, 2.5, 3], gymnasium.error.Error, "float|2.5"),
}


@pytest.mark.parametrize("case", SEEDS)
def test_seeds_that_do_not_fit_are_refused(case):
    seed, error, message = SEEDS[case]
    refuses(begun(three), lambda env: env.reset(seed=seed), error, message)


MASKS = {
    "list": ([True, False, True], TypeError, r"\[True, False, True\]"),
    "numbers": (np.array([1, 0, 1]), TypeError, r"array\(\[1, 0, 1\]\)"),
    "too short": (np.array([True, False]), ValueError, r"shape \(2,\)"),
    "too long": (np.ones(4, dtype=bool), ValueError, r"shape \(4,\)"),
    "column": (np.ones((3, 1), dtype=bool), ValueError, r"shape \(3, 1\)"),
    "none true": (np.zeros(3, dtype=bool), ValueError, "0 true entries"),
    "one bool": (True, TypeError, "True"),
}


@pytest.mark.parametrize("case", MASKS)
def test_a_mask_that_does_not_fit_is_refused(case):
    mask, error, message = MASKS[case]
    refuses(
        begun(three),
        lambda env: env.reset(seed=5, options={"reset_mask": mask}),
        error,
        f"reset_mask.*{message}",
    )


def test_one_world_knows_no_reset_mask():
    mask = np.array([True])
    refuses(begun(), lambda env: env.reset(options={"reset_mask": mask}), ValueError, "reset_mask")


def test_an_ended_world_is_not_stepped_where_autoreset_is_disabled():
    env = make_vec(ROPE, 5, task=FragileRope, autoreset_mode="DISABLED").unwrapped
    env.reset(seed=11)
    for action in random_actions(env, 60):
        *_, terminated, _, _ = env.step(action)
        if terminated.any():
            break
    world = np.flatnonzero(terminated)[0]
    refuses(env, lambda env: env.step(action), RuntimeError, f"world {world} has ended")
    env.reset(options={"reset_mask": terminated})
    env.step(action)


def test_staggering_is_on_or_off_and_needs_a_time_limit():
    with pytest.raises(TypeError, match="stagger is 'half'; expected True or False"):
        three(stagger="half")
    with pytest.raises(ValueError, match="stagger is True; without max_episode_steps"):
        three(max_episode_steps=None, stagger=True)


@pytest.mark.parametrize("mode", ["SOMETIMES", "same_step", None, 3])
def test_an_unknown_autoreset_mode_is_refused(mode):
    with pytest.raises(ValueError, match=f"autoreset_mode is {mode!r}; allowed: NEXT_STEP"):
        three(autoreset_mode=mode)


@pytest.mark.parametrize("number", [0, -1, 2.5, "two", None])
def test_a_batch_of_no_whole_number_of_worlds_is_refused(number):
    with pytest.raises((TypeError, ValueError), match=f"num_envs is {number!r}"):
        make_vec(ROPE, number)


@pytest.mark.parametrize("number", [0, -1, 1.5, "two"])
def test_a_batch_on_no_whole_number_of_threads_is_refused(number):
    with pytest.raises(ValueError, match=f"num_threads is {number!r}"):
        three(num_threads=number)


@pytest.mark.parametrize("limit", [0, -1, 2.5, "ten"])
def test_a_limit_of_no_whole_number_of_steps_is_refused(limit):
    with pytest.raises((TypeError, ValueError), match=f"max_episode_steps is {limit!r}"):
        three(max_episode_steps=limit)


def test_a_batch_has_no_window():
    with pytest.raises(ValueError, match=r"'human'.*'rgb_array'"):
        three(render_mode="human")
