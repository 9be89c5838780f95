"""The upper bound: never below the optimum, and equal to the textbook without drones' paths."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from small_searches import SMALL, best, paths_of, search, shortened, success_of

from DroneSwarmSearch import Drift, Person
from DroneSwarmSearch.bound import CHECKS, chernoff_bound
from DroneSwarmSearch.evaluation import NamedSearch, evaluate
from DroneSwarmSearch.planning import SuccessBound, success_bound
from DroneSwarmSearch.policies import make

STEPS = 5
"""So few that all trajectories can be enumerated: 9 to the power of 4 at most."""


@cache
def exact_bound(index: int) -> SuccessBound:
    """The bound of a search of `SMALL`, for `STEPS` steps and all fewer."""
    of = shortened(SMALL[index], STEPS)
    horizons = STEPS if index in (4, 8) else 1
    return success_bound(of.scenario, of.drones, horizons=horizons, memory=STEPS)


class TestSmallSearches:
    @pytest.mark.thorough
    @pytest.mark.parametrize("index", [1, 4, 6, 8, 10, 12, 13])
    def test_is_never_below_the_optimum_and_nearly_that_of_a_single_drone(self, index):
        """A drone that remembers everything never counts a detection twice."""
        bound = exact_bound(index)
        assert bound.confidence == 1.0
        assert bound.by_limit >= best(index, STEPS) - 1e-12
        assert 0.0 <= bound.gap < 0.01 * bound.by_limit
        if len(SMALL[index].drones) == 1:
            assert bound.by_limit <= 1.01 * best(index, STEPS)

    def test_is_exact_if_the_drone_has_no_choice(self):
        """The drone is in the cell of a stationary person, and can only search."""
        of = search(
            [(2, 2)], grid_size=5, person_initial_position=(2, 2), vector=(0, 0),
            disperse_constant=0, timestep_limit=4, probability_of_detection=0.3,
        )  # fmt: skip
        for memory in (3, None):
            bound = success_bound(of.scenario, of.drones, memory=memory)
            np.testing.assert_allclose(bound.by_time, 1 - 0.7 ** np.arange(5), rtol=0.01)
            assert bound.relaxed == pytest.approx(1 - 0.7**4, rel=0.01)


class TestSuccessBound:
    def search(self, **changes: Any) -> NamedSearch:
        drift = {"person_initial_position": (2, 3), "vector": (0.2, -0.4), "disperse_constant": 6}
        defaults = {"grid_size": 5, "timestep_limit": 5, **drift}
        return search([(0, 0), (4, 0)], **{**defaults, **changes})

    def bound(self, horizons: int = 1, **changes: Any) -> SuccessBound:
        of = self.search(**changes)
        return success_bound(of.scenario, of.drones, horizons=horizons, memory=2)

    @pytest.mark.thorough
    def test_for_several_persons_is_the_product(self):
        cells = [(2, 3), (4, 1), (1, 1), (2, 3)]
        detections = (0.9, 0.5, 0.4, 0.9)
        together = self.bound(2, person_initial_position=cells, probability_of_detection=detections)
        of_each = [
            self.bound(2, person_initial_position=cell, probability_of_detection=detection)
            for cell, detection in zip(cells, detections, strict=True)
        ]
        assert len({bound.by_time.tobytes() for bound in of_each}) == 3
        product = np.prod([bound.by_time for bound in of_each], axis=0)
        np.testing.assert_allclose(together.by_time, product, rtol=1e-12)
        value = math.prod(bound.relaxed for bound in of_each)
        assert together.relaxed == pytest.approx(value)
        upper = math.prod(bound.relaxed + bound.gap for bound in of_each)
        assert together.gap == pytest.approx(upper - value)

    @pytest.mark.thorough
    def test_of_a_coverage_mission_is_the_mean_over_persons(self):
        easy = Person(Drift((0, 1), diffusion=0.2), 0.9)
        hard = Person([Drift((2, 3), diffusion=0.4), Drift((4, 4))], 0.3)
        of = [
            search(
                [(0, 0), (4, 0)], grid_size=5, timestep_limit=5, persons=each, mission="coverage"
            )
            for each in ([easy], [hard], [hard, easy, hard])
        ]
        one, other, both = (
            success_bound(each.scenario, each.drones, horizons=5, memory=2) for each in of
        )
        np.testing.assert_allclose(both.by_time, (one.by_time + 2 * other.by_time) / 3, rtol=1e-12)
        assert both.gap == pytest.approx((one.gap + 2 * other.gap) / 3)
        assert both.relaxed == pytest.approx((one.relaxed + 2 * other.relaxed) / 3)
        reached = success_of(of[2], paths_of(make("planner", of[2].scenario), of[2]))
        assert other.by_limit < np.mean(reached) <= both.by_limit

    def test_fewer_horizons_give_a_valid_but_looser_bound(self):
        fine = self.bound(5)
        coarse = self.bound(1)
        assert (coarse.by_time[1:] == coarse.by_limit).all()
        assert (coarse.by_time >= fine.by_time).all()
        assert coarse.by_time[2] > fine.by_time[2] + 0.01


SAMPLED = search(
    [(0, 0), (8, 4)], grid_size=9, person_initial_position=(4, 4), vector=(0.1, -0.1),
    disperse_constant=3, timestep_limit=14, probability_of_detection=0.8,
)  # fmt: skip
"""A search with too many trajectories to enumerate."""


@cache
def sampled_bound() -> SuccessBound:
    return success_bound(
        SAMPLED.scenario, SAMPLED.drones, sample=4096, gap=0.03, horizons=3, memory=2
    )


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["planner", "greedy-posterior"])
def test_no_policy_exceeds_the_bound(name):
    bound = sampled_bound()
    episodes = 400
    assert bound.confidence == 0.999
    found_by = evaluate(name, SAMPLED, episodes=episodes, progress=False).episodes.found_at[:, 0]
    for step in range(1, SAMPLED.scenario.timestep_limit + 1):
        most = bound.by_time[step]
        rate = float(np.mean((found_by > 0) & (found_by <= step)))
        assert rate <= most + 4 * math.sqrt(most * (1 - most) / episodes)
    policy = make(name, SAMPLED.scenario)
    assert success_of(SAMPLED, paths_of(policy, SAMPLED))[0] <= bound.by_limit


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("persons", "detections", "sampled"),
    [
        ([(1, 1), (2, 2), (1, 1)], (1.0, 1.0, 1.0), 2),  # equal persons share one bound
        ([(1, 1), (1, 1)], (1.0, 0.9), 2),
        ([(1, 1), (0, 0)], (1.0, 1.0), 1),  # from the corner, all trajectories are enumerated
    ],
)
def test_a_sampled_bound_is_valid_for_all_persons_and_steps_together(persons, detections, sampled):
    """The probability of failure, one in a thousand: nine tenths are for the time limit."""

    def bound(cells: list[tuple[int, int]], of_each: tuple[float, ...]) -> SuccessBound:
        of = search(
            [(0, 0)], grid_size=4, person_initial_position=cells, timestep_limit=7,
            vector=(0.3, 0.2), disperse_constant=12, probability_of_detection=of_each,
        )  # fmt: skip
        return success_bound(of.scenario, of.drones, sample=2000, gap=0.1, horizons=1, memory=1)

    expected = 1.0
    for cell, detection in zip(persons, detections, strict=True):
        alone = bound([cell], (detection,))
        upper_bound = alone.relaxed + alone.gap
        if cell != (0, 0):
            upper_bound = chernoff_bound(upper_bound, 2000, 1 - 0.0009 / sampled / CHECKS)
        expected *= upper_bound
        assert alone.confidence == (1.0 if cell == (0, 0) else 0.999)
    together = bound(persons, detections)
    assert together.by_limit == pytest.approx(expected, rel=1e-9)
    assert together.confidence == 0.999


def test_what_cannot_end_or_fit_is_refused():
    of = shortened(SMALL[0], 2)
    with pytest.raises(ValueError, match="memory must be an integer from 0 to 5, got 30"):
        success_bound(of.scenario, of.drones, memory=30)
    with pytest.raises(ValueError, match="sample must be an integer from 1 to 134217728, got 10"):
        success_bound(of.scenario, of.drones, sample=10**9)
