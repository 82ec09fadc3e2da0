import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import j0

from pbd_gym.physics import ModelBuilder, shapes
from scenes import GRAVITY, momenta, rope_2d, strain, world


def driven(particles, *, seconds=10.0, implicit=True, slack=False, payload=0.0):
    """Largest stretch and compression of a rope of 1 m whose held end sways 0.25 m at 1 Hz."""
    rope = {"implicit": implicit, "slack": slack, "payload": payload}
    state = world(rope_2d(particles, pins=[0], rope=rope))
    pairs, rest = state.model.links()
    longest, shortest = 0.0, 0.0
    for step in range(1, round(60 * seconds) + 1):
        sway = 0.25 * np.sin(2.0 * np.pi * step / 60.0)
        state.step(1 / 60, targets=np.array([[[sway, 0.0]]]))
        lengths = np.linalg.norm(state.x[0, pairs[:, 0]] - state.x[0, pairs[:, 1]], axis=1)
        longest = max(longest, (lengths / rest).max() - 1.0)
        shortest = min(shortest, (lengths / rest).min() - 1.0)
    # nothing within 0.25 m of height and 2 pi 0.25 m/s of the hand makes it much faster than this;
    # the whip of a free end does
    assert np.abs(state.v).max() < 30.0
    return longest, -shortest


@pytest.mark.parametrize(
    ("particles", "payload"), [(32, 0.0), (32, 4.0), (256, 0.0), (256, 4.0), (256, 200.0)]
)
def test_a_driven_rope_keeps_its_length_whatever_it_carries(particles, payload):
    # it follows its pin link by link: rounding of positions of 1 m in links of 1/255 m
    assert max(driven(particles, payload=payload)) < 1e-10


def test_a_long_rope_between_two_hands_keeps_its_length():
    share = np.linspace(0.0, 1.0, 256)
    points = np.stack([0.6 * share, -0.8 * np.minimum(share, 1.0 - share)], axis=1)
    builder = ModelBuilder(2)
    indices = shapes.chain(builder, points, 0.2 / 256, implicit=True)
    builder.pin(indices[[0, -1]])
    state = world(builder.build())
    for step in range(1, 301):
        sway = 0.1 * np.sin(2.0 * np.pi * step / 60.0)
        state.step(1 / 60, targets=np.array([[[sway, 0.0], [0.6, 0.0]]]))
        # nothing can follow two pins: one explicit correction is left, of links that lie as they
        # will; a hundredth of the half percent that a rope may stretch
        assert strain(state) < 5e-5


def test_a_slack_rope_is_never_longer_but_may_be_shorter():
    longest, shortest = driven(32, slack=True)
    assert longest < 1e-12
    assert shortest > 0.1  # the whip of its end runs back into the rope
    longest, shortest = driven(256, slack=True, seconds=3.0)
    assert longest < 1e-10


@pytest.mark.parametrize("slack", [False, True])
def test_a_rope_carries_a_thousand_times_the_mass_of_its_particles(slack):
    state = world(
        rope_2d(20, pins=[0], rope={"mass": 0.02, "payload": 1.0, "slack": slack, "implicit": True})
    )
    for _ in range(300):
        state.step(1 / 60)
        assert strain(state) < 1e-12
    assert np.abs(state.v).max() < 1e-10  # and hangs still


@pytest.mark.parametrize("slack", [False, True])
def test_an_elastic_rope_stretches_by_the_law_of_hooke(slack):
    rope = {"mass": 0.6, "compliance": 1e-3, "slack": slack, "implicit": True}
    state = world(rope_2d(6, pins=[0], rope=rope, damping=4.0, iterations=3))
    for _ in range(600):
        state.step(1 / 60)
    carried = np.arange(5, 0, -1) * 0.1
    stretch = np.diff(-state.x[0, :, 1]) - 1.0 / 5.0
    # as an explicit chain: its slowest mode has decayed by exp(-20)
    np.testing.assert_allclose(stretch, 1e-3 * carried * GRAVITY, rtol=1e-6)


def test_a_slack_rope_thrown_up_does_not_push():
    states = [
        world(rope_2d(2, pins=[0], rope=kind)) for kind in ({"slack": True}, {"implicit": True})
    ]
    for state in states:
        state.v[0, 1] = (0.0, 1.0)
        state.step(0.1)
    slack, rigid = states
    # 0.1 s of free flight, up to the first order of the integrator, h g t/2 = 5e-3 m
    assert slack.x[0, 1, 1] == pytest.approx(-1.0 + 0.1 - 0.5 * GRAVITY * 0.01, abs=6e-3)
    assert rigid.x[0, 1, 1] == pytest.approx(-1.0, abs=1e-12)


@pytest.mark.parametrize("slack", [False, True])
def test_a_free_rope_keeps_its_momentum_when_implicit(slack):
    rope = {"implicit": True, "slack": slack}
    state = world(rope_2d(20, gravity=(0.0, 0.0), iterations=2, rope=rope))
    state.v[0] = np.random.default_rng(1).normal(size=(20, 2))
    before, _ = momenta(state)
    for _ in range(100):
        state.step(0.01)
    # as for an explicit chain: rounding of 1e-16 m / 1e-3 s in each of 1000 substeps
    np.testing.assert_allclose(momenta(state)[0], before, atol=1e-11)


def funicular(links, length, span):
    """Sag of `links` equal links between two level points: each turns by the weight it carries."""
    weights = np.arange(links) - (links - 1) / 2.0

    def reach(tension):
        slopes = weights / tension
        return np.sum(length / links / np.sqrt(1.0 + slopes**2)) - span

    slopes = weights / brentq(reach, 1e-3, 1e3 * links)
    rise = length / links * slopes / np.sqrt(1.0 + slopes**2)
    return -np.cumsum(rise).min()


@pytest.mark.parametrize("links", [10, 20, 40])
def test_a_hanging_chain_is_a_catenary(links):
    length, span = 1.2, 1.0
    builder = ModelBuilder(2)
    at = np.linspace(-1.0, 1.0, links + 1)
    start = np.stack([0.5 * span * at, 0.33 * (np.abs(at) - 1.0)], axis=1)
    indices = builder.add_particles(start, 0.01)
    builder.add_chain(indices, rest=length / links, implicit=True)
    builder.pin(indices[[0, -1]])
    state = world(builder.build(damping=6.0, iterations=2))
    for _ in range(300):
        state.step(1 / 60)
    sag = -state.x[0, :, 1].min()
    # the polygon of the links is exact but for what the second part of the solve leaves, h^2 g
    assert sag == pytest.approx(funicular(links, length, span), abs=GRAVITY / 600**2)
    # and the catenary, S = 2a sinh(D/2a), is its limit: their distance goes with 1/links^2
    a = brentq(lambda a: 2.0 * a * np.sinh(0.5 * span / a) - length, 0.1, 10.0)
    sag_of_catenary = a * (np.cosh(0.5 * span / a) - 1.0)
    assert sag == pytest.approx(sag_of_catenary, abs=0.2 / links**2)


def period(signal, step):
    """Mean time between upward passages through zero [s]."""
    ups = np.flatnonzero((signal[:-1] < 0.0) & (signal[1:] >= 0.0))
    passages = ups - signal[ups] / (signal[ups + 1] - signal[ups])
    return step * (passages[-1] - passages[0]) / (len(passages) - 1)


@pytest.mark.parametrize(("mode", "zero"), [(1, 2.404826), (2, 5.520078), (3, 8.653728)])
def test_a_hanging_chain_swings_in_the_modes_of_bessel(mode, zero):
    links = 40
    depth = np.linspace(0.0, 1.0, links + 1)
    masses = np.full(links + 1, 0.01)
    masses[-1] *= 0.5
    builder = ModelBuilder(2)
    points = np.stack([1e-4 * j0(zero * np.sqrt(1.0 - depth)), -depth], axis=1)
    indices = shapes.chain(builder, points, masses, implicit=True)
    builder.pin(indices[0])
    state = world(builder.build())
    tips = []
    for _ in range(round(3.5 * 120 * 2.0 * np.pi / (0.5 * zero * np.sqrt(GRAVITY)))):
        state.step(1 / 120, 20)
        tips.append(state.x[0, -1, 0])
    # omega = j0_k/2 sqrt(g/L) with lumped masses to (mode/links)^2, and atan(omega h)/h of the
    # scheme, which is 1e-5 of it
    frequency = 2.0 * np.pi / period(np.array(tips), 1 / 120)
    assert frequency == pytest.approx(
        0.5 * zero * np.sqrt(GRAVITY), rel=2.0 * (mode / links) ** 2 + 1e-4
    )


@pytest.mark.parametrize("mode", [1, 2, 3])
def test_a_taut_string_swings_in_its_harmonics(mode):
    links, tension, density = 40, 1.0, 1.0
    link = 1.0 / links
    at = np.linspace(0.0, 1.0, links + 1)
    points = np.stack([at, 1e-4 * np.sin(mode * np.pi * at)], axis=1)
    builder = ModelBuilder(2)
    indices = builder.add_particles(points, density * link)
    # stretched by a tenth: rest and compliance that pull with 1 N
    builder.add_chain(
        indices, rest=link / 1.1, compliance=(link - link / 1.1) / tension, implicit=True
    )
    builder.pin(indices[[0, -1]])
    state = world(builder.build(gravity=(0.0, 0.0)))
    antinode = round(links / (2 * mode))
    heights = []
    for _ in range(round(3.5 * 120 * 2.0 / mode)):
        state.step(1 / 120, 20)
        heights.append(state.x[0, antinode, 1])
    # f_n = n/2L sqrt(T/mu); the polygon swings slower by (n pi/2 links)^2/6
    frequency = 1.0 / period(np.array(heights), 1 / 120)
    exact = 0.5 * mode * np.sqrt(tension / density)
    assert frequency == pytest.approx(exact, rel=(0.5 * np.pi * mode / links) ** 2 / 6 + 2e-4)


def test_implicit_chains_have_no_strain_limit_and_are_checked():
    builder = ModelBuilder(2)
    builder.add_particles([(0, 0), (1, 0), (2, 0)], 1.0)
    with pytest.raises(ValueError, match=r"strain_limit of a slack or implicit chain is 0\.1"):
        builder.add_chain([0, 1], slack=True, strain_limit=0.1)
    builder.add_chain([0, 1, 0], slack=True)
    with pytest.raises(ValueError, match="implicit chain 0 visits particle 0 twice"):
        builder.build()
