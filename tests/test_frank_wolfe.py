"""The Frank-Wolfe method and its objectives: tangents lie above, textbook optima are met."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from small_searches import forecast_of, paths_of, search, success_of

from DroneSwarmSearch._internal.erf import erf
from DroneSwarmSearch.drift import Drift, ProbabilityMatrix
from DroneSwarmSearch.planning.bound import drone_paths
from DroneSwarmSearch.planning.frank_wolfe import frank_wolfe
from DroneSwarmSearch.planning.memory import RememberingDrones
from DroneSwarmSearch.planning.objectives import MarkovChainObjective, TrajectoryObjective
from DroneSwarmSearch.planning.paths import Path, values_to_go
from DroneSwarmSearch.planning.trajectories import enumerate_trajectories
from DroneSwarmSearch.policies import make

Floats = np.ndarray


def expected(collected: Floats, probabilities: Floats, detection: float) -> float:
    """E[min(Z, g(N))], with g(N) = 1 - (1 - q)^N joined by straight lines at whole N."""
    credits, searches = collected
    whole = np.arange(math.ceil(searches.max()) + 1.0)
    success = np.interp(searches, whole, 1 - (1 - detection) ** whole)
    return float(probabilities @ np.minimum(credits, success))


class TestObjectives:
    OF = search(
        [(0, 0), (2, 0)], grid_size=5, person_initial_position=(2, 3), vector=(0.2, -0.4),
        disperse_constant=6, timestep_limit=5, probability_of_detection=0.6,
    )  # fmt: skip
    FORECAST = forecast_of(OF)
    SHAPE = (5, 5, 5)

    def chain(self, effort: Floats, rate: float) -> MarkovChainObjective:
        return MarkovChainObjective(self.FORECAST, rate, effort.reshape(self.SHAPE))

    def test_at_deterministic_paths_equal_the_success_of_the_plan(self) -> None:
        paths = paths_of(make("greedy-posterior", self.OF.scenario), self.OF)
        success = success_of(self.OF, paths)[0]
        assert success > 0.1
        effort = np.zeros((5, 25))
        for path in paths:
            steps = path.searches.nonzero()[0]
            effort[steps, path.cells[steps]] += 1.0
        exact = self.chain(effort, -math.log(0.4)).value()
        assert exact == pytest.approx(success, rel=1e-12)
        for memory in (0, 1, 4):
            drones = self.drones(0.6, memory)
            collected = drones.collected(paths)
            assert success <= expected(collected, drones.probabilities, 0.6) + 1e-12
        # With all of its memory, a single drone's credits are exact.
        collected = drones.collected(paths[:1])
        alone = success_of(self.OF, paths[:1])[0]
        assert expected(collected, drones.probabilities, 0.6) == pytest.approx(alone, rel=1e-12)

    def drones(self, detection: float, memory: int) -> RememberingDrones:
        trajectories = enumerate_trajectories(self.FORECAST, 5)
        assert trajectories is not None
        return RememberingDrones(trajectories, 5, detection, [0, 2], memory)

    def paths(self, rng: np.random.Generator) -> list[Path]:
        """The best paths for random weights."""
        drones = self.drones(1.0, 0)
        return drones(rng.random((2, len(drones.probabilities))))[1]

    def test_tangents_of_the_chain_objective_touch_and_lie_above(self) -> None:
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

    @pytest.mark.parametrize("memory", [0, 2])
    @pytest.mark.parametrize("detection", [1.0, 0.6])
    def test_tangents_of_the_trajectory_objective_lie_above(
        self, detection: float, memory: int
    ) -> None:
        rng = np.random.default_rng(1)
        drones = self.drones(detection, memory)
        objective = TrajectoryObjective(drones)
        assert objective.value() == 0.0
        mixture = np.zeros((2, len(drones.probabilities)))
        for _ in range(12):
            intercept, weights = objective.tangent()
            assert (weights >= 0).all()
            for amount in (0.01, 0.3, 1.0):
                other = mixture + amount * (drones.collected(self.paths(rng)) - mixture)
                above = intercept + np.vdot(weights, other)
                assert expected(other, drones.probabilities, detection) <= above + 1e-12
                mixture = other if amount == 0.3 else mixture
            objective.move_towards(self.paths(rng))
        assert 0.0 < objective.value() <= intercept + drones(weights)[0]

    def test_the_chain_objective_is_the_larger_one(self) -> None:
        chain = self.chain(np.zeros(125), -math.log(0.4))
        drones = self.drones(0.6, 0)
        lower = frank_wolfe(TrajectoryObjective(drones), drones, gap=0.005, iterations=300)
        upper = frank_wolfe(chain, partial(drone_paths, [0, 2]), gap=0.005, iterations=300)
        assert lower.value <= lower.upper_bound
        assert lower.value <= upper.upper_bound
        assert lower.upper_bound - lower.value == lower.gap <= 0.005 * lower.upper_bound


def test_drone_paths_gain_as_much_as_the_best_paths() -> None:
    gains = np.random.default_rng(3).random((6, 4, 4))
    starts = [0, 7, 15]
    gained, effort = drone_paths(starts, gains)
    values = values_to_go(gains, np.zeros((4, 4)))[0].reshape(-1)
    assert gained == pytest.approx(values[starts].sum(), rel=1e-12)
    assert gained == pytest.approx(np.vdot(gains, effort))
    assert effort.sum() <= 18


def free_effort(amount: float) -> Callable[[Floats], tuple[float, Floats]]:
    """The oracle of searchers without paths: a fixed effort in each step, in any cell."""

    def oracle(gains: Floats) -> tuple[float, Floats]:
        flat, effort = gains.reshape(len(gains), -1), np.zeros_like(gains)
        effort.reshape(flat.shape)[np.arange(len(gains)), flat.argmax(axis=1)] = amount
        return amount * float(flat.max(axis=1).sum()), effort

    return oracle


class TestFreeEffort:
    """Without paths, the method solves the classical problem of optimal search effort."""

    SIDE, SIGMA = 27, 3.5

    @classmethod
    def normal(cls) -> Floats:
        """A circular normal prior over fine cells: float64, shape (N, N)."""
        edges = (np.arange(cls.SIDE + 1) - cls.SIDE / 2) / cls.SIGMA
        chances = np.diff(erf(edges / math.sqrt(2))) / 2
        return np.multiply.outer(chances, chances) / chances.sum() ** 2

    @pytest.mark.parametrize(("tau", "chance"), [(0.5, 0.158279), (2.0, 0.413064), (8.0, 0.773718)])
    def test_around_a_datum(self, tau: float, chance: float) -> None:
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
