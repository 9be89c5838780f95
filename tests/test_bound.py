"""The bound: never below what is possible, and equal to the textbooks where flying is left out."""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_searches import SMALL, best, chances, flown, forecast_of, search, shortened

from DroneSwarmSearch._internal.erf import erf
from DroneSwarmSearch.drift import ProbabilityMatrix
from DroneSwarmSearch.evaluation import NamedSearch, evaluate
from DroneSwarmSearch.planning import SuccessBound, success_bound
from DroneSwarmSearch.planning.bound import (
    AlongChain,
    AlongTrajectories,
    Effort,
    anywhere,
    chernoff_limit,
    enumerated_trajectories,
    flights,
    frank_wolfe,
    sampled_trajectories,
)
from DroneSwarmSearch.planning.chain import Chain
from DroneSwarmSearch.planning.paths import values_to_go
from DroneSwarmSearch.policies import make

Floats = np.ndarray

STEPS = 5
"""So few that all ways can be enumerated: 9 to the power of 4 at most."""


@cache
def exact_bound(index: int) -> SuccessBound:
    """The bound of a search of `SMALL`, for `STEPS` steps and all fewer."""
    of = shortened(SMALL[index], STEPS)
    return success_bound(of.scenario, of.drones, horizons=STEPS if index in (4, 8) else 1)


INDICES = range(len(SMALL))


class TestSmallSearches:
    @pytest.mark.parametrize("index", INDICES)
    def test_is_exact_and_never_below_the_best_plan(self, index: int) -> None:
        bound = exact_bound(index)
        assert bound.confidence == 1.0
        assert bound.by_limit >= best(index, STEPS) - 1e-12
        assert 0.0 <= bound.gap < 0.01 * bound.by_limit

    @pytest.mark.parametrize("index", [4, 8])
    def test_holds_for_every_number_of_steps(self, index: int) -> None:
        bound = exact_bound(index)
        for steps in range(1, STEPS + 1):
            assert bound.by_time[steps] >= best(index, steps) - 1e-12

    @pytest.mark.parametrize("index", INDICES)
    def test_is_0_at_first_and_never_falls(self, index: int) -> None:
        bound = exact_bound(index)
        assert bound.by_time.shape == (STEPS + 1,)
        assert bound.by_time.dtype == np.float64
        assert bound.by_time[0] == 0.0
        assert (np.diff(bound.by_time) >= 0.0).all()
        assert bound.by_limit == bound.by_time[-1] <= 1.0

    def test_is_near_the_best_plan_where_effort_cannot_be_spread(self) -> None:
        """A drone above the datum of a person who hardly strays has nothing to choose."""
        of = search(
            [(2, 2)], grid_size=5, person_initial_position=(2, 2), vector=(0, 0),
            disperse_constant=0, timestep_limit=4, probability_of_detection=0.3,
        )  # fmt: skip
        bound = success_bound(of.scenario, of.drones)
        np.testing.assert_allclose(bound.by_time, 1 - 0.7 ** np.arange(5), rtol=0.01)
        assert bound.relaxed == pytest.approx(1 - 0.7**4, rel=0.01)


class TestWholeBound:
    def search(self, **changes: Any) -> NamedSearch:
        usual = {
            "grid_size": 5,
            "person_initial_position": (2, 3),
            "vector": (0.2, -0.4),
            "disperse_constant": 6,
            "timestep_limit": 5,
        }
        return search([(0, 0), (4, 0)], **{**usual, **changes})

    def bound(self, horizons: int = 1, **changes: Any) -> SuccessBound:
        of = self.search(**changes)
        return success_bound(of.scenario, of.drones, horizons=horizons)

    def test_of_several_persons_is_that_of_the_hardest_to_find(self) -> None:
        cells, detections = [(2, 3), (4, 1), (1, 1), (2, 3)], (0.9, 0.5, 0.4, 0.9)
        together = self.bound(5, person_initial_position=cells, probability_of_detection=detections)
        apart = [
            self.bound(5, person_initial_position=cell, probability_of_detection=detection)
            for cell, detection in zip(cells[:3], detections[:3], strict=True)
        ]
        lowest = np.min([bound.by_time for bound in apart], axis=0)
        assert together.by_time.tolist() == lowest.tolist()
        hardest = min(apart, key=lambda bound: bound.by_limit)
        assert (together.relaxed, together.gap) == (hardest.relaxed, hardest.gap)
        curves = {bound.by_time.tobytes() for bound in apart}
        assert len(curves) == 3

    def test_falls_with_the_probability_of_detection(self) -> None:
        bounds = [
            self.bound(probability_of_detection=q).by_limit for q in (1.0, 0.8, 0.5, 0.2, 0.0)
        ]
        assert all(more > less + 0.01 for more, less in pairwise(bounds))
        assert bounds[-1] == 0.0

    def test_fewer_horizons_give_a_limit_too(self) -> None:
        fine, coarse = self.bound(5), self.bound(1)
        assert (coarse.by_time[1:] == coarse.by_limit).all()
        assert (coarse.by_time >= fine.by_time).all()
        assert coarse.by_time[2] > fine.by_time[2] + 0.01

    @pytest.mark.parametrize("sample", [None, 2000])
    def test_the_same_call_gives_the_same_bits(self, sample: int | None) -> None:
        of = self.search() if sample is None else self.search(timestep_limit=9)
        options = {} if sample is None else {"sample": sample}
        one, two = (
            success_bound(of.scenario, of.drones, horizons=2, gap=0.05, **options) for _ in range(2)
        )
        assert one.confidence == (1.0 if sample is None else 0.999)
        assert one.by_time.tobytes() == two.by_time.tobytes()
        assert (one.relaxed, one.gap) == (two.relaxed, two.gap)

    def test_tells_how_far_it_is(self) -> None:
        told: list[float] = []
        of = self.search(person_initial_position=[(2, 3), (0, 0)], timestep_limit=4)
        success_bound(of.scenario, of.drones, horizons=4, gap=0.1, report=told.append)
        assert len(told) == 8
        assert told == sorted(told)
        assert told[-1] == 1.0

    def test_what_the_drones_are_shown_makes_no_difference(self) -> None:
        one, two = self.bound(), self.bound(bayesian_update=True)
        assert one.by_time.tobytes() == two.by_time.tobytes()


SAMPLED = search(
    [(0, 0), (8, 4)], grid_size=9, person_initial_position=(4, 4), vector=(0.1, -0.1),
    disperse_constant=3, timestep_limit=18, probability_of_detection=0.8,
)  # fmt: skip
"""A search with more ways than can be enumerated."""


@cache
def sampled_bound() -> SuccessBound:
    return success_bound(SAMPLED.scenario, SAMPLED.drones, sample=8192, gap=0.03, horizons=4)


@pytest.mark.parametrize("name", ["planner", "greedy-posterior", "sector-search"])
def test_policies_never_find_more_often_than_the_bound_allows(name: str) -> None:
    bound, episodes = sampled_bound(), 1000
    assert bound.confidence == 0.999
    found_by = evaluate(name, SAMPLED, episodes=episodes, progress=False).found_by
    for step in range(1, SAMPLED.scenario.timestep_limit + 1):
        limit = bound.by_time[step]
        share = float(np.mean((found_by > 0) & (found_by <= step)))
        assert share <= limit + 4 * math.sqrt(limit * (1 - limit) / episodes)
    policy = make(name, SAMPLED.scenario)
    assert chances(SAMPLED, flown(policy, SAMPLED))[0] <= bound.by_limit


def test_a_sampled_bound_allows_for_the_sample() -> None:
    of = search([(0, 0)], grid_size=5, person_initial_position=(3, 3), timestep_limit=8)
    bound = success_bound(of.scenario, of.drones, sample=3000, gap=0.05, horizons=1)
    reached = bound.relaxed + bound.gap
    assert bound.by_limit == pytest.approx(chernoff_limit(reached, 3000, 0.999), rel=1e-12)
    assert reached + 0.01 < bound.by_limit < 1.0
    assert bound.confidence == 0.999


@pytest.mark.parametrize(
    ("persons", "detections", "horizons", "solutions"),
    [
        ([(1, 1)], 1.0, 4, 4),
        ([(1, 1), (1, 2)], 1.0, 1, 2),
        ([(1, 1), (2, 2), (1, 1)], 1.0, 3, 6),  # two persons alike share one bound
        ([(1, 1), (1, 1)], (1.0, 0.9), 2, 4),
        ([(1, 1)], 1.0, 50, 7),  # no more horizons than steps
        ([(1, 1), (0, 0)], 1.0, 3, 3),  # the corner has few enough ways to enumerate
    ],
)
def test_a_sampled_bound_holds_for_all_persons_and_steps_together(
    persons: list[tuple[int, int]], detections: Any, horizons: int, solutions: int
) -> None:
    """The probability of failure, one in a thousand, is divided among the sampled solutions."""
    of = search(
        [(0, 0)], grid_size=4, person_initial_position=persons, timestep_limit=7,
        vector=(0.3, 0.2), disperse_constant=12, probability_of_detection=detections,
    )  # fmt: skip
    bound = success_bound(of.scenario, of.drones, sample=2000, gap=0.1, horizons=horizons)
    limit = chernoff_limit(bound.relaxed + bound.gap, 2000, 1 - 0.001 / solutions)
    assert bound.by_limit == pytest.approx(limit, rel=1e-9)
    assert bound.confidence == 0.999


def test_the_planner_does_not_fall_far_short_of_the_bound() -> None:
    """A bound that nothing came near would be of no use."""
    bound = sampled_bound()
    reached = chances(SAMPLED, flown(make("planner", SAMPLED.scenario), SAMPLED))[0]
    assert reached > 0.6 * bound.by_limit
    assert bound.by_limit < 0.95


class TestChernoff:
    @settings(deadline=None, max_examples=60, derandomize=True)
    @given(
        st.one_of(st.just(0.0), st.floats(1e-6, 1 - 1e-6)),
        st.integers(1, 10**6),
        st.floats(0.5, 0.9999),
    )
    def test_is_where_relative_entropy_has_used_up_the_confidence(
        self, mean: float, count: int, confidence: float
    ) -> None:
        p = chernoff_limit(mean, count, confidence)
        assert mean <= p <= 1.0
        allowed = -math.log(1 - confidence) / count

        def entropy(p: float) -> float:
            of_mean = mean * math.log(mean / p) if mean else 0.0
            return of_mean + (1 - mean) * math.log((1 - mean) / (1 - p))

        assert entropy(min(p + 1e-9, 1 - 1e-16)) >= allowed * (1 - 1e-6) or p > 1 - 1e-9
        assert entropy(max(p - 1e-9, mean)) <= allowed * (1 + 1e-6)

    def test_without_a_success(self) -> None:
        # (1 - p)^n = 1 - confidence
        assert chernoff_limit(0.0, 100, 0.999) == pytest.approx(1 - 0.001**0.01, rel=1e-9)

    def test_is_1_where_the_mean_is(self) -> None:
        assert chernoff_limit(1.0, 100, 0.9) == 1.0

    def test_is_monotone(self) -> None:
        means = np.linspace(0, 1, 60)
        limits = [chernoff_limit(mean, 200, 0.99) for mean in means]
        assert (np.diff(limits) > 0).all()
        assert (np.array(limits[:-1]) > means[:-1]).all()
        more = [chernoff_limit(0.3, count, 0.99) for count in (1, 10, 100, 1000, 10**6)]
        assert (np.diff(more) < 0).all()
        surer = [chernoff_limit(0.3, 200, confidence) for confidence in (0.5, 0.9, 0.99, 0.999)]
        assert (np.diff(surer) > 0).all()

    @pytest.mark.parametrize("p", [0.03, 0.4, 0.9])
    def test_fails_no_more_often_than_it_says(self, p: float) -> None:
        n, confidence = 80, 0.95
        failing = sum(
            math.comb(n, k) * p**k * (1 - p) ** (n - k)
            for k in range(n + 1)
            if chernoff_limit(k / n, n, confidence) < p
        )
        assert failing <= 1 - confidence


class TestWays:
    LAW = ProbabilityMatrix(5, (1, 3), (0.4, -0.2), 8)

    def test_all_of_them_are_the_forecast(self) -> None:
        ways = enumerated_trajectories(self.LAW, 5)
        assert ways is not None
        assert ways.chances.sum() == pytest.approx(1.0, rel=1e-12)
        assert len(np.unique(ways.cells, axis=1).T) == len(ways.chances)
        for step in range(5):
            reached = np.bincount(ways.cells[step], ways.chances, 25).reshape(5, 5)
            np.testing.assert_allclose(reached, self.LAW.exact(step), atol=1e-13)
        product = np.ones(len(ways.chances))
        for step in range(4):
            (y, x), (v, u) = (np.divmod(ways.cells[t], 5) for t in (step, step + 1))
            for here, there, up, down in ((x, u, 0, 1), (y, v, 2, 3)):
                higher, lower = (self.LAW.moves(step)[axis][here] for axis in (up, down))
                assert (abs(there - here) <= 1).all()
                product *= np.select(
                    [there > here, there < here], [higher, lower], 1 - higher - lower
                )
        np.testing.assert_allclose(ways.chances, product, rtol=1e-12)

    def test_a_sample_of_them_follows_the_forecast(self) -> None:
        count = 20_000
        ways = sampled_trajectories(self.LAW, 12, count)
        assert enumerated_trajectories(self.LAW, 12) is None
        assert ways.cells.shape == (12, count)
        assert (ways.chances == 1 / count).all()
        for step in range(12):
            shares = np.bincount(ways.cells[step], minlength=25).reshape(5, 5) / count
            forecast = self.LAW.exact(step)
            assert (
                abs(shares - forecast) <= 4.5 * np.sqrt(forecast * (1 - forecast) / count) + 1e-12
            ).all()
        y, x = np.divmod(ways.cells, 5)
        assert max(abs(np.diff(x, axis=0)).max(), abs(np.diff(y, axis=0)).max()) == 1
        # From one cell in one step, the moves are those of the chain.
        here = ways.cells[5] == 13
        right, left, *_ = (chance[3] for chance in self.LAW.moves(5))
        for gone, chance in ((1, right), (-1, left)):
            share = float(np.mean(x[6, here] - x[5, here] == gone))
            assert abs(share - chance) < 4 * math.sqrt(chance * (1 - chance) / here.sum())

    def test_their_beginnings(self) -> None:
        ways = enumerated_trajectories(self.LAW, 5)
        assert np.array_equal(ways.until(3).cells, ways.cells[:3])
        assert ways.until(3).chances is ways.chances


def along(ways: Any, effort: Floats, detection: float) -> float:
    """E[g(s)]: 1 - (1 - q)^s of the sum along each way, and straight lines between whole s."""
    steps = np.arange(len(ways.cells))[:, None]
    sums = effort.reshape(len(ways.cells), -1)[steps, ways.cells].sum(axis=0)
    whole = np.arange(math.ceil(sums.max()) + 1.0)
    return float(ways.chances @ np.interp(sums, whole, 1 - (1 - detection) ** whole))


def effort_of(array: Floats) -> Effort:
    flat = array.reshape(-1)
    return Effort(flat.nonzero()[0], flat[flat.nonzero()])


class TestObjectives:
    OF = search(
        [(0, 0), (2, 0)], grid_size=5, person_initial_position=(2, 3), vector=(0.2, -0.4),
        disperse_constant=6, timestep_limit=5, probability_of_detection=0.6,
    )  # fmt: skip
    LAW = forecast_of(OF)
    SHAPE = (5, 5, 5)

    def chain(self, effort: Floats, rate: Any) -> AlongChain:
        return AlongChain(Chain(self.LAW, 0.6, 0, 5), self.LAW.exact(0), rate, effort.reshape(-1))

    def test_of_whole_flights_are_the_chances_of_the_plan(self) -> None:
        paths = flown(make("greedy-posterior", self.OF.scenario), self.OF)
        expected = chances(self.OF, paths)[0]
        assert expected > 0.1
        effort = np.zeros((5, 25))
        for path in paths:
            steps = path.searches.nonzero()[0]
            effort[steps, path.cells[steps]] += 1.0
        exact = self.chain(effort, -math.log(0.4)).value()
        assert exact == pytest.approx(expected, rel=1e-12)
        ways = enumerated_trajectories(self.LAW, 5)
        assert along(ways, effort, 0.6) == pytest.approx(expected, rel=1e-12)

    def test_along_the_chain_tangents_touch_and_lie_above(self) -> None:
        rng = np.random.default_rng(0)
        rate = rng.random((5, 5)) + 0.5
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

    @pytest.mark.parametrize("detection", [1.0, 0.6])
    def test_along_the_ways_tangents_lie_above(self, detection: float) -> None:
        rng = np.random.default_rng(1)
        ways = enumerated_trajectories(self.LAW, 5)
        objective = AlongTrajectories(ways, 5, detection)
        assert objective.value() == 0.0
        for _ in range(12):
            intercept, gains = objective.tangent()
            assert gains.shape == self.SHAPE
            assert (gains >= 0).all()
            for spread in (0.0, 0.01, 0.3, 2.0):
                other = rng.random(self.SHAPE) * spread
                above = intercept + np.vdot(gains, other)
                assert along(ways, other, detection) <= above + 1e-12
            objective.approach(effort_of(rng.random(self.SHAPE)))
        assert 0.0 < objective.value() <= intercept + gains.max(axis=(1, 2)).sum() * 25

    @pytest.mark.parametrize("detection", [1.0, 0.6])
    def test_along_the_ways_the_point_is_on_the_line_to_the_target(self, detection: float) -> None:
        """Towards half a search of every cell in the last step, nearly the whole way."""
        ways = enumerated_trajectories(self.LAW, 5)
        target = np.zeros(self.SHAPE)
        target[4] = 0.5
        objective = AlongTrajectories(ways, 5, detection)
        objective.approach(effort_of(target))
        assert along(ways, target, detection) == pytest.approx(detection / 2)
        assert 0.9 * detection / 2 < objective.value() <= detection / 2

    def test_the_function_along_the_chain_is_the_larger_one(self) -> None:
        oracle = flights([0, 2])
        ways = AlongTrajectories(enumerated_trajectories(self.LAW, 5), 5, 0.6)
        chain = self.chain(np.zeros(125), -math.log(0.4))
        lower = frank_wolfe(ways, oracle, gap=0.005, iterations=300)
        upper = frank_wolfe(chain, oracle, gap=0.005, iterations=300)
        assert lower.value <= lower.limit
        assert lower.value <= upper.limit
        assert lower.limit - lower.value == lower.gap <= 0.005 * lower.limit

    def test_a_sample_comes_near_the_whole(self) -> None:
        """Twelve steps: more ways than are enumerated, of which the sampled value is a mean."""
        forecast = self.LAW
        chain = AlongChain(
            Chain(forecast, 0.6, 0, 12), forecast.exact(0), -math.log(0.4), np.zeros(300)
        )
        ways = sampled_trajectories(forecast, 12, 4000)
        oracle = flights([0, 2])
        sampled = frank_wolfe(AlongTrajectories(ways, 5, 0.6), oracle, gap=0.02, iterations=60)
        exact = frank_wolfe(chain, oracle, gap=0.02, iterations=60)
        assert sampled.value <= exact.limit + 4 * math.sqrt(0.25 / 4000)


class TestOracles:
    def test_flights_gain_what_the_best_paths_do(self) -> None:
        gains = np.random.default_rng(3).random((6, 4, 4))
        starts = [0, 7, 15]
        gained, effort = flights(starts)(gains)
        values = values_to_go(gains, np.zeros((4, 4)))[0].reshape(-1)
        assert gained == pytest.approx(values[starts].sum(), rel=1e-12)
        assert gained == pytest.approx(gains.reshape(-1)[effort.places] @ effort.amounts)
        assert (effort.amounts == 1.0).all()
        assert len(effort.places) <= 18

    def test_effort_anywhere_goes_where_it_gains_most_in_each_step(self) -> None:
        gains = np.random.default_rng(4).random((6, 4, 4))
        gained, effort = anywhere(2.5)(gains)
        assert gained == pytest.approx(2.5 * gains.max(axis=(1, 2)).sum(), rel=1e-12)
        assert gained == pytest.approx(gains.reshape(-1)[effort.places] @ effort.amounts)
        assert np.array_equal(effort.places // 16, np.arange(6))


def still_chain(size: int, steps: int) -> Chain:
    """Of a person who stays."""
    return Chain(ProbabilityMatrix(size, (0, 0), (0.0, 0.0), 0.0), 1.0, 0, steps)


class TestEffortAnywhere:
    """Without flying, the method solves the classical problem of optimal search effort."""

    def test_over_three_cells(self) -> None:
        """Charnes and Cooper (Management Science 5:44, 1958): the optimum is in closed form."""
        rates, chance = np.array([9.0, 3.0, 6.0]), np.array([2.0, 4.0, 2.0])
        first, rate = np.append(chance / 8, 0.0).reshape(2, 2), np.append(rates, 1.0).reshape(2, 2)
        effort = np.zeros(4)
        objective = AlongChain(still_chain(2, 1), first, rate, effort)
        reached = frank_wolfe(objective, anywhere(0.2), gap=0.0, iterations=1500)
        best_effort = np.array([0.073224, 0.0845173, 0.0422587])
        np.testing.assert_allclose(effort[:3], best_effort, rtol=0.01)
        assert effort[3] == 0.0
        assert effort.sum() == pytest.approx(0.2, rel=0.001)
        most = float(chance / 8 @ (1 - np.exp(-rates * best_effort)))
        assert reached.value <= most + 1e-6
        assert reached.limit >= most - 1e-6
        assert reached.gap < 0.001 * most

    SIDE, SIGMA = 27, 3.5

    @classmethod
    def normal(cls) -> Floats:
        """A circular normal forecast over fine cells: float64, shape (N, N)."""
        edges = (np.arange(cls.SIDE + 1) - cls.SIDE / 2) / cls.SIGMA
        chances = np.diff(erf(edges / math.sqrt(2))) / 2
        return np.multiply.outer(chances, chances) / chances.sum() ** 2

    @classmethod
    def searched(cls, tau: float, steps: int = 1) -> tuple[Any, Floats]:
        """The optimum reached and its effort; tau is H² t = W v t / (pi sigma²)."""
        effort = np.zeros(steps * cls.SIDE**2)
        objective = AlongChain(still_chain(cls.SIDE, steps), cls.normal(), 1.0, effort)
        amount = tau * math.pi * cls.SIGMA**2 / steps
        reached = frank_wolfe(objective, anywhere(amount), gap=0.003, iterations=2500)
        return reached, effort.reshape(steps, cls.SIDE, cls.SIDE).sum(axis=0)

    @pytest.mark.parametrize(
        ("tau", "chance"),
        [(0.5, 0.158279), (1.0, 0.264241), (2.0, 0.413064), (4.0, 0.593994), (8.0, 0.773718)],
    )
    def test_around_a_datum(self, tau: float, chance: float) -> None:
        """Koopman's table (Search and Screening, 1946): 1 - (1 + sqrt(tau)) exp(-sqrt(tau))."""
        assert chance == pytest.approx(
            1 - (1 + math.sqrt(tau)) * math.exp(-math.sqrt(tau)), abs=1e-6
        )
        reached, _ = self.searched(tau)
        assert reached.value == pytest.approx(chance, rel=0.01)
        assert reached.limit == pytest.approx(chance, rel=0.01)

    def test_is_the_same_in_several_steps_if_the_person_stays(self) -> None:
        reached, _ = self.searched(1.0, steps=3)
        assert reached.value == pytest.approx(0.264241, rel=0.01)
        assert reached.limit == pytest.approx(0.264241, rel=0.01)

    def test_leaves_a_posterior_that_is_flat_within_the_searched_radius(self) -> None:
        """Stone (Theory of Optimal Search, 1975): R² = 2 sigma² sqrt(tau)."""
        tau = 0.5
        _, effort = self.searched(tau)
        radius = self.SIGMA * math.sqrt(2 * math.sqrt(tau))
        y, x = np.indices(effort.shape) - (self.SIDE - 1) / 2
        within, beyond = np.hypot(x, y) < radius - 1, np.hypot(x, y) > radius + 1
        posterior = self.normal() * np.exp(-effort)
        prior = self.normal()[within]
        assert prior.min() < 0.8 * prior.max()
        assert posterior[within].min() > 0.95 * posterior[within].max()
        assert effort[beyond].sum() == 0.0
        assert posterior[beyond].max() < posterior[within].min()
