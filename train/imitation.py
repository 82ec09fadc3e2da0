"""Imitation of a regulator: a network learns what it would do wherever the network itself leads.

DAgger (S. Ross, G. Gordon and J. A. Bagnell 2011): rounds of motion, first under the regulator,
then more and more under the network, label every state that they meet with the regulator's action;
the network is fitted to all of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import nn

from pendulum_model import PendulumModel
from regulator import Regulator

# The noise that actions get, one drawn for each episode: it spreads the states about the motion.
_NOISE = (0.0, 0.005, 0.01, 0.02, 0.03)
_LEAST_VARIANCE = 1e-4  # of a whitened direction, else rounding would be blown up


@dataclass(frozen=True, kw_only=True)
class ImitationSettings:
    """How a regulator is imitated.

    Attributes:
        worlds: Pendulums that move at once.
        rounds: Of motion and fitting.
        first: Control steps of the first round, enough for a swing-up.
        steps: Control steps of every other round.
        top: Least and greatest time at the top, drawn for each episode [control steps].
        led: Rounds until the share of episodes that the regulator leads has fallen to a tenth.
        updates: Of the network in each round.
        batch_size: States in each update.
        learning_rate: At first; it falls to 0 along half a cosine.
        hidden: Units of each of the two hidden layers.
        lost: Cost to go beyond which an episode is given up: the regulator is of no use there.
    """

    worlds: int = 512
    rounds: int = 12
    first: int = 300
    steps: int = 100
    top: tuple[int, int] = (50, 200)
    led: int = 10
    updates: int = 600
    batch_size: int = 2048
    learning_rate: float = 2e-3
    hidden: int = 126
    lost: float = 30.0

    @property
    def timesteps(self) -> int:
        """Control steps of all rounds and worlds."""
        return self.worlds * (self.first + (self.rounds - 1) * self.steps)


class Examples(NamedTuple):
    """States with what to do in them.

    Attributes:
        observations: (E, size) float32.
        actions: (E,) float32.
        weights: How much each counts, (E,) float32.
    """

    observations: np.ndarray
    actions: np.ndarray
    weights: np.ndarray


class Student(nn.Module):
    """A network from observations (W, size) to actions (W,), on whitened observations.

    It gives what the action differs from keeping the pivot's velocity. Whitening (Y. LeCun et al.
    1998) shows it the small differences between directions that decide at the top.

    Args:
        observations: That are whitened to mean 0 and covariance 1, (E, size).
        hidden: Units of each hidden layer.
        scale: Of the difference [actions].
    """

    def __init__(self, observations: np.ndarray, hidden: int, scale: float) -> None:
        super().__init__()
        values = observations.astype(np.float64)
        variances, directions = np.linalg.eigh(np.cov(values.T))
        whitening = directions / np.sqrt(np.maximum(variances, 0.0) + _LEAST_VARIANCE)
        self.mean = torch.tensor(values.mean(axis=0), dtype=torch.float32)
        self.whitening = torch.tensor(whitening, dtype=torch.float32)
        self.scale = scale
        self.first = nn.Linear(len(whitening), hidden)
        self.second = nn.Linear(hidden, hidden)
        self.last = nn.Linear(hidden, 1)
        self.activation = nn.SiLU()

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return actions (W,), not clipped."""
        white = (observations - self.mean) @ self.whitening
        hidden = self.activation(self.second(self.activation(self.first(white))))
        return observations[:, 1] + self.scale * self.last(hidden)[:, 0]

    @torch.no_grad()
    def act(self, observations: np.ndarray) -> np.ndarray:
        """Return actions (W,), not clipped."""
        return self(torch.as_tensor(observations)).numpy()

    @torch.no_grad()
    def layers(self) -> list[tuple[torch.Tensor, torch.Tensor]]:
        """Return weights and biases of the same function as three plain layers with SiLU between.

        The whitening goes into the first layer. Two more units of each hidden layer carry the
        pivot's velocity x past it: silu(x) - silu(-x) = x.
        """
        size = len(self.mean)
        keep = torch.zeros(2, size)
        keep[:, 1] = torch.tensor([1.0, -1.0])
        fold = self.first.weight @ self.whitening.T
        first = torch.cat([fold, keep])
        first_bias = torch.cat([self.first.bias - fold @ self.mean, torch.zeros(2)])
        carry = torch.tensor([[1.0, -1.0], [-1.0, 1.0]])
        second = torch.block_diag(self.second.weight, carry)
        second_bias = torch.cat([self.second.bias, torch.zeros(2)])
        last = torch.cat([self.scale * self.last.weight, torch.tensor([[1.0, -1.0]])], dim=1)
        return [(first, first_bias), (second, second_bias), (last, self.scale * self.last.bias)]

    @torch.no_grad()
    def copy_to(self, policy: Any) -> None:
        """Make a policy of stable-baselines3 act alike.

        Args:
            policy: An "MlpPolicy" with two hidden layers of `hidden` + 2 units and SiLU.
        """
        net = policy.mlp_extractor.policy_net
        layers = net[0], net[2], policy.action_net
        for layer, (weight, bias) in zip(layers, self.layers(), strict=True):
            layer.weight.copy_(weight)
            layer.bias.copy_(bias)


class Imitation:
    """Worlds, examples and the student that is fitted to them.

    Attributes:
        student: None before the first round.
        rounds: Done so far.
    """

    def __init__(
        self,
        model: PendulumModel,
        regulator: Regulator,
        settings: ImitationSettings,
        random: np.random.Generator,
    ) -> None:
        self.settings = settings
        self.student: Student | None = None
        self.rounds = 0
        self._model, self._regulator, self._random = model, regulator, random
        self._scale = model.most / model.task.max_speed
        worlds = settings.worlds
        self._states = model.draw(worlds, random)
        self._ages, self._lives = np.zeros(worlds, dtype=int), np.zeros(worlds, dtype=int)
        self._led, self._noise = np.zeros(worlds, dtype=bool), np.zeros(worlds)
        self._examples: list[Examples] = []

    def play_round(self, progress: Callable[[float], None]) -> None:
        """Let the pendulums move, and fit the student to all that was seen.

        Args:
            progress: Called with the loss after each update; may raise to end the round.
        """
        first = self.student is None
        led = 1.0 if first else max(0.1, 1.0 - self.rounds / self.settings.led)
        self._examples.append(
            self._move(self.settings.first if first else self.settings.steps, led)
        )
        if self.student is None:
            observations = self._examples[0].observations
            self.student = Student(observations, self.settings.hidden, self._scale)
            self._optimizer = torch.optim.Adam(self.student.parameters())
        self._fit(self.student, progress)
        self.rounds += 1

    def _move(self, steps: int, led: float) -> Examples:
        """Return what to do in each state of some steps, of which a share of episodes is led."""
        seen = []
        for _ in range(steps):
            over = self._ages >= self._lives
            self._begin(over, led)
            observations = self._model.observe(self._states)
            command = self._regulator(self._states)
            target = self._model.possible(self._states, command.push)
            wanted = (self._states[:, 1] + target) / self._model.task.max_speed
            weights = 1.0 / (1.0 + command.cost)
            seen.append((observations, wanted.astype(np.float32), weights.astype(np.float32)))
            action = wanted if self.student is None else self.student.act(observations)
            action = np.where(self._led, wanted, action)
            action = action + self._noise * self._random.standard_normal(len(action))
            pushes = self._model.push(self._states, np.clip(action, -1.0, 1.0))
            self._states = self._model.step(self._states, pushes)
            self._ages += 1
            self._lives[command.cost > self.settings.lost] = 0
        return Examples(*map(np.concatenate, zip(*seen, strict=True)))

    def _begin(self, worlds: np.ndarray, led: float) -> None:
        """Begin new episodes in some worlds, (W,) bool, a share of them led."""
        count = int(worlds.sum())
        self._states[worlds] = self._model.draw(count, self._random)
        self._ages[worlds] = 0
        top = self._random.integers(*self.settings.top, count)
        self._lives[worlds] = self._regulator.arrival + top
        self._led[worlds] = self._random.random(count) < led
        self._noise[worlds] = self._random.choice(_NOISE, count)

    def _fit(self, student: Student, progress: Callable[[float], None]) -> None:
        """Fit the student to all examples for a round of updates."""
        settings = self.settings
        joined = map(np.concatenate, zip(*self._examples, strict=True))
        observations, actions, weights = map(torch.as_tensor, joined)
        for update in range(settings.updates):
            done = (self.rounds + update / settings.updates) / settings.rounds
            rate = 0.5 * settings.learning_rate * (1.0 + np.cos(np.pi * done))
            self._optimizer.param_groups[0]["lr"] = rate
            chosen = torch.randint(len(actions), (settings.batch_size,))
            error = (student(observations[chosen]) - actions[chosen]) / self._scale
            loss = (weights[chosen] * error.square()).mean()
            self._optimizer.zero_grad()
            loss.backward()
            self._optimizer.step()
            progress(loss.item())
