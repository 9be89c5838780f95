"""The Frank-Wolfe method and its objective: tangents lie above, textbook optima are met."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from small_searches import forecast_of, paths_of, search, success_of

from DroneSwarmSearch._internal.erf import erf
from DroneSwarmSearch.bound import MarkovChainObjective, frank_wolfe
from DroneSwarmSearch.drift import ProbabilityMatrix
from DroneSwarmSearch.persons import Drift
from DroneSwarmSearch.policies import make

Floats = np.ndarray


class TestObjective:
    OF = search(
        [(0, 0), (2, 0)], grid_size=5, person_initial_position=(2, 3), vector=(0.2, -0.4),
        disperse_constant=6, timestep_limit=5, probability_of_detection=0.6,
    )  # fmt: skip
    FORECAST = forecast_of(OF)
    SHAPE = (5, 5, 5)

    def chain(self, effort: Floats, rate: float) -> MarkovChainObjective:
        return MarkovChainObjective(self.FORECAST, rate, effort.reshape(self.SHAPE))

    def test_at_deterministic_paths_equal_the_success_of_the_plan(self):
        paths = paths_of(make("greedy-posterior", self.OF.scenario), self.OF)
        success = success_of(self.OF, paths)[0]
        assert success > 0.1
        effort = np.zeros((5, 25))
        for path in paths:
            steps = path.searches.nonzero()[0]
            effort[steps, path.cells[steps]] += 1.0
        exact = self.chain(effort, -math.log(0.4)).value()
        assert exact == pytest.approx(success, rel=1e-12)

    def test_tangents_of_the_chain_objective_touch_and_lie_above(self):
        rng = np.random.default_rng(0)
        rate = 0.8
        point = rng.random(self.SHAPE)
        objective = self.chain(point.copy(), rate)
        value = objective.value()
        intercept, gains = objective.tangent()
        assert gains.shape == self.SHAPE
        assert (gains >= 0).all()
        assert intercept + np.vdot(gains, point) == pytest.approx(value, rel=1e-12)
        for place in [(0, 3, 2), (2, 2, 2), (4, 1, 3)]:
            aside = point.copy()
            aside[place] += 1e-6
            slope = (self.chain(aside, rate).value() - value) / 1e-6
            assert gains[place] == pytest.approx(slope, rel=1e-4)
        for spread in (0.01, 0.5, 3.0):
            other = rng.random(self.SHAPE) * spread
            assert self.chain(other, rate).value() <= intercept + np.vdot(gains, other) + 1e-12


def free_effort(amount: float) -> Callable[[Floats], tuple[float, Floats]]:
    """The oracle of searchers without paths: a fixed effort in each step, in any cell."""

    def oracle(gains: Floats) -> tuple[float, Floats]:
        flat = gains.reshape(len(gains), -1)
        effort = np.zeros_like(gains)
        effort.reshape(flat.shape)[np.arange(len(gains)), flat.argmax(axis=1)] = amount
        return amount * float(flat.max(axis=1).sum()), effort

    return oracle


class TestFreeEffort:
    """Without paths, the method solves the classical problem of optimal search effort."""

    SIDE = 27
    SIGMA = 3.5

    @classmethod
    def normal(cls) -> Floats:
        """A circular normal prior over fine cells: float64, shape (N, N)."""
        edges = (np.arange(cls.SIDE + 1) - cls.SIDE / 2) / cls.SIGMA
        chances = np.diff(erf(edges / math.sqrt(2))) / 2
        return np.multiply.outer(chances, chances) / chances.sum() ** 2

    @pytest.mark.parametrize(("tau", "chance"), [(0.5, 0.158279), (2.0, 0.413064), (8.0, 0.773718)])
    def test_around_a_datum(self, tau, chance):
        """Koopman's table (Search and Screening, 1946): 1 - (1 + sqrt(tau)) exp(-sqrt(tau)).

        tau is H² t = W v t / (pi sigma²).
        """
        assert chance == pytest.approx(
            1 - (1 + math.sqrt(tau)) * math.exp(-math.sqrt(tau)), abs=1e-6
        )
        stationary = ProbabilityMatrix(self.SIDE, Drift(self.normal()))
        objective = MarkovChainObjective(stationary, 1.0, np.zeros((1, self.SIDE, self.SIDE)))
        amount = tau * math.pi * self.SIGMA**2
        reached = frank_wolfe(objective, free_effort(amount), gap=0.003, iterations=2500)
        assert reached.value == pytest.approx(chance, rel=0.01)
        assert reached.upper_bound == pytest.approx(chance, rel=0.01)
