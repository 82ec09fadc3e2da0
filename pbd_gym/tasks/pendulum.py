"""Pendulums of one to five links on a rail: swing up by moving the pivot, and balance."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from pbd_gym.physics import Model, ModelBuilder, shapes
from pbd_gym.physics.compiling import entry
from pbd_gym.physics.portable import cos_sin
from pbd_gym.tasks.balancing import SwingUp
from pbd_gym.tasks.base import Draw, Judgement, Start, Task, Variables, draw, number
from pbd_gym.tasks.rewards import near_each, quiet

_PI = 3.141592653589793


@dataclass(frozen=True, kw_only=True)
class Pendulum(Task):
    """A pendulum hangs from a pivot on a rail; it must be swung up and balanced near the middle.

    ## Description
    `links` massless rods of equal length, 1 m together, with a bob of 1 kg at the end of each, hang
    from a pivot that the agent moves along a horizontal rail of 3 m. Second-order integration keeps
    the energy of a free pendulum to 0.1 % over minutes.

    ## Action Space
    `Box(-1, 1, (1,), float32)`: desired velocity of the pivot along the rail in units of
    `max_speed` (3 m/s). The pivot's velocity follows with at most `max_acceleration` (30 m/s2) and
    brakes before the ends of the rail. Actions beyond [-1, 1] are clipped.

    ## Observation Space
    `Box(-10, 10, (2 + 4 links,), float32)`; both kinds of observation are the same here.

    | Num            | Observation                                      | Unit             |
    |----------------|--------------------------------------------------|------------------|
    | 0              | pivot's position                                 | half the rail    |
    | 1              | pivot's velocity                                 | `max_speed`      |
    | 2 ... 1+2links | direction of each link, from top to bottom, x, y | link lengths     |
    | then 2 links   | rate of change of each direction, x, y           | 5 link lengths/s |

    ## Rewards
    The product of dm_control's swing-up task, in [0, 1]: upright * (1 + centred)/2 * (1 + slow)/2 *
    (4 + quiet)/5 with upright = mean of (1 + cos theta_i)/2, centred = tolerance of the pivot's
    position (0.1 at the rail's end), slow = least tolerance of the links' angular velocities (0.1
    at 5 rad/s), quiet = 1 - action^2.

    ## Starting State
    The pivot rests in the middle, every link within `start_angle` (0.1 rad) of hanging down, with
    rates within `start_rate` (0.1 rad/s). With the probability `start_upright` (0) the pendulum
    stands on its head instead: episodes for training, as a learner that begins by hanging alone
    hardly ever sees what balancing is worth.

    ## Episode End
    Truncated after 500 steps (10 s). Success: over the last 50 steps every cos theta_i > 0.99 (0.98
    with more than one link) and the pivot within 0.75 of half the rail. Terminated only if the
    simulation diverges, which does not happen with the defaults.

    ## Arguments
    ```python
    >>> import gymnasium
    >>> env = gymnasium.make("pbd_gym:PBDDoublePendulum-v0", gravity=1.62)
    >>> observation, info = env.reset(seed=1, options={"angles": [3.0, 3.0]})

    ```
    Every field of the class is a keyword. `reset` takes the options `angles` [rad from hanging
    down, each link's own], `rates` [rad/s] and `pivot` [m]; where `start_upright` is not 0, also
    `stand`: below `start_upright` the pendulum begins turned upside down, angles and all.

    ## Version History
    * v0: first version
    """

    links: int = number(1, 1, 5)
    length: float = number(1.0, 0.1, 10.0, "m")
    mass: float = number(1.0, 1e-3, 1e3, "kg")
    rail: float = number(1.5, 0.1, 100.0, "m")
    control_rate: float = number(50.0, 1.0, 1000.0, "Hz")
    substeps: int = number(10, 1, 1000)
    max_speed: float = number(3.0, 1e-3, 100.0, "m/s")
    max_acceleration: float = number(30.0, 1e-3, 1000.0, "m/s2")
    damping: float = number(0.0, 0.0, 100.0, "1/s")
    start_angle: float = number(0.1, 0.0, _PI, "rad")
    start_rate: float = number(0.1, 0.0, 10.0, "rad/s")
    start_upright: float = number(0.0, 0.0, 1.0)

    hold_steps: ClassVar[int] = 50
    best_performance: ClassVar[float] = 1.0
    action_axes: ClassVar[tuple[int, ...]] = (0,)

    @property
    def link_length(self) -> float:
        """Length of a link [m]."""
        return self.length / self.links

    def build(self) -> Model:
        """Build the hanging pendulum."""
        builder = ModelBuilder(2)
        lengths, masses = [self.link_length] * self.links, [self.mass] * self.links
        shapes.pendulum(builder, (0.0, 0.0), lengths, masses)
        return builder.build(
            gravity=(0.0, -self.gravity),
            damping=self.damping,
            integrator="rattle",
            iterations=2,
        )

    def workspace(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the ends of the rail."""
        return np.array([-self.rail, 0.0]), np.array([self.rail, 0.0])

    @property
    def view(self) -> tuple[np.ndarray, np.ndarray]:
        """The rail and the circle that the pendulum reaches."""
        reach = 1.15 * self.length
        return np.array([-self.rail - 0.3, -reach]), np.array([self.rail + 0.3, reach])

    @property
    def rails(self) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
        """The rail of the pivot."""
        return (self.workspace(),)

    def declare_draws(self) -> dict[str, Draw]:
        """Draw angles and rates about hanging at rest; the pivot starts in the middle."""
        each = np.ones(self.links)
        angle, rate = self.start_angle * each, self.start_rate * each
        draws = {
            "angles": draw(-angle, angle, -_PI * each, _PI * each),
            "rates": draw(-rate, rate, -10.0 * each, 10.0 * each),
            "pivot": draw(0.0, 0.0, -self.rail, self.rail),
        }
        if self.start_upright > 0.0:  # else one number less is drawn
            draws["stand"] = draw(0.0, 1.0)
        return draws

    def start(self, quantities: dict[str, np.ndarray]) -> Start:
        """Place the links at their angles, turning at their rates; upside down where they stand."""
        count = len(quantities["angles"])
        upside = np.zeros((count, 1))
        if "stand" in quantities:
            upside = (quantities["stand"] < self.start_upright).astype(np.float64)
        x = np.empty((count, self.links + 1, 2), dtype=np.float32)
        v = np.empty_like(x)
        swing = *cos_sin(quantities["angles"]), quantities["rates"], quantities["pivot"], upside
        _place(*map(np.ascontiguousarray, swing), self.link_length, x, v)
        return Start(x, v, {})

    @cached_property
    def _scales(self) -> np.ndarray:
        """What the pivot's position and velocity, directions and their rates are multiplied by."""
        link = 1.0 / self.link_length
        scales = [1.0 / self.rail, 1.0 / self.max_speed, link, 0.2 * link]
        return np.array(scales, dtype=np.float32)

    def observe(self, x: np.ndarray, v: np.ndarray, variables: Variables) -> np.ndarray:
        """Return the pivot, the links' directions and their rates of change."""
        observations = np.empty((len(x), 2 + 4 * self.links), dtype=x.dtype)
        _observe(x, v, self._scales, observations)
        return observations

    def judge(
        self, x: np.ndarray, v: np.ndarray, action: np.ndarray, variables: Variables
    ) -> Judgement:
        """Judge as dm_control judges its cart-pole."""
        parts = np.empty((5, len(x)))
        reached = np.empty(len(x), dtype=bool)
        least = 0.99 if self.links == 1 else 0.98
        _judge(x, v, action, self.link_length, self.rail, least, parts, reached)
        upright, centred, slow, still, reward = parts
        terms = {"upright": upright, "centred": centred, "slow": slow, "quiet": still}
        return Judgement(reward, reached, upright, terms)

    @cached_property
    def _swing_up(self) -> SwingUp:
        return SwingUp(
            links=self.links,
            link_length=self.link_length,
            gravity=self.gravity,
            dt=1.0 / self.control_rate,
            max_speed=self.max_speed,
            max_acceleration=self.max_acceleration,
            rail=self.rail,
        )

    def scripted(self, observation: np.ndarray) -> np.ndarray:
        """Pump energy in until the links pass the top slowly, then balance by linear feedback."""
        observation = observation.astype(np.float64)
        count = 2 * self.links
        shape = (len(observation), self.links, 2)
        return self._swing_up.act(
            pivot=observation[:, 0] * self.rail,
            velocity=observation[:, 1] * self.max_speed,
            direction=observation[:, 2 : 2 + count].reshape(shape),
            motion=observation[:, 2 + count :].reshape(shape) * 5.0,
        )


@entry
def _place(
    cosine: Any, sine: Any, rates: Any, pivot: Any, upside: Any, link_length: float, x: Any, v: Any
) -> None:
    """Place n pendulums at their angles from hanging down, turning at their rates.

    Args:
        cosine: Of the angles, (n, links).
        sine: (n, links).
        rates: (n, links) [rad/s].
        pivot: Position along the rail (n, 1) [m].
        upside: (n, 1), 1 for what is then turned upside down, else 0.
        link_length: [m].
        x: Positions (n, N, 2) [m], written.
        v: Velocities (n, N, 2) [m/s], written.
    """
    for world in range(x.shape[0]):
        sign = link_length if upside[world, 0] == 0.0 else -link_length
        across, up, forwards, upwards = 0.0, 0.0, 0.0, 0.0
        x[world, 0, 0], x[world, 0, 1] = pivot[world, 0], 0.0
        v[world, 0, 0], v[world, 0, 1] = 0.0, 0.0
        for link in range(cosine.shape[1]):
            c, s, rate = cosine[world, link], sine[world, link], rates[world, link]
            across += sign * s
            up -= sign * c
            forwards += sign * c * rate
            upwards += sign * s * rate
            x[world, link + 1, 0] = across + pivot[world, 0]
            x[world, link + 1, 1] = up
            v[world, link + 1, 0], v[world, link + 1, 1] = forwards, upwards


@entry
def _observe(x: Any, v: Any, scales: Any, observations: Any) -> None:
    """Write the observations of n worlds; see the class for what they hold."""
    links = x.shape[1] - 1
    for world in range(x.shape[0]):
        observations[world, 0] = x[world, 0, 0] * scales[0]
        observations[world, 1] = v[world, 0, 0] * scales[1]
        for link in range(links):
            for axis in range(2):
                along = x[world, link + 1, axis] - x[world, link, axis]
                rate = v[world, link + 1, axis] - v[world, link, axis]
                observations[world, 2 + 2 * link + axis] = along * scales[2]
                observations[world, 2 + 2 * (links + link) + axis] = rate * scales[3]


@entry
def _judge(
    x: Any,
    v: Any,
    action: Any,
    link_length: float,
    rail: float,
    least: float,
    parts: Any,
    reached: Any,
) -> None:
    """Judge n worlds.

    Args:
        x: Positions (n, N, 2) [m].
        v: Velocities (n, N, 2) [m/s].
        action: (n, 1) in [-1, 1].
        link_length: [m].
        rail: Half the rail [m].
        least: cos theta of every link above which the pendulum is up.
        parts: (5, n): upright, centred, slow, quiet and reward, written.
        reached: (n,) bool, written.
    """
    links = x.shape[1] - 1
    upright, centred, slow, still, reward = parts[0], parts[1], parts[2], parts[3], parts[4]
    for world in range(x.shape[0]):
        pivot = np.float64(x[world, 0, 0])
        upright[world], centred[world], slow[world] = 0.0, pivot, 1.0
        still[world] = quiet(np.float64(action[world, 0]))
        reached[world] = abs(pivot) < 0.75 * rail
    near_each(centred, rail)
    for link in range(links):
        rate = reward  # a row that is not needed yet
        for world in range(x.shape[0]):
            height = np.float64(x[world, link + 1, 1] - x[world, link, 1]) / link_length
            height = min(max(height, -1.0), 1.0)
            upright[world] += 0.5 * (1.0 + height)
            reached[world] &= height > least
            # links keep their length, so the rate of a direction is the angular velocity
            across = np.float64(v[world, link + 1, 0] - v[world, link, 0]) / link_length
            along = np.float64(v[world, link + 1, 1] - v[world, link, 1]) / link_length
            rate[world] = np.sqrt(across * across + along * along)
        near_each(rate, 5.0)
        for world in range(x.shape[0]):
            slow[world] = min(slow[world], rate[world])
    for world in range(x.shape[0]):
        upright[world] /= links
        product = upright[world] * (1.0 + centred[world]) * (1.0 + slow[world])
        reward[world] = product * (4.0 + still[world]) / 20.0
