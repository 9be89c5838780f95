"""The search patterns: legs, turns and coverage of the tracks, and how drones follow them."""

import math
from collections import Counter
from itertools import pairwise
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from DroneSwarmSearch import Action, DroneSwarmSearch, Scenario
from DroneSwarmSearch.core import Cell
from DroneSwarmSearch.drift import ProbabilityMatrix
from DroneSwarmSearch.persons import Drift, Person
from DroneSwarmSearch.policies import (
    CreepingLinePolicy,
    ExpandingSquarePolicy,
    ParallelSweepPolicy,
    SectorSearchPolicy,
)
from DroneSwarmSearch.policies.datum import Datum, datums_of
from DroneSwarmSearch.policies.pattern_tracks import (
    Rectangle,
    cells_along,
    expanding_square,
    parallel_track,
    sector_search,
    strips_of,
)
from DroneSwarmSearch.policies.patterns import PatternPolicy

PATTERNS = [ParallelSweepPolicy, CreepingLinePolicy, ExpandingSquarePolicy, SectorSearchPolicy]


def cells_of(area: Rectangle) -> set[Cell]:
    return {
        (x, y)
        for x in range(area.x, area.x + area.width)
        for y in range(area.y, area.y + area.height)
    }


def adjacent(a: Cell, b: Cell) -> bool:
    return abs(a[0] - b[0]) + abs(a[1] - b[1]) == 1


rectangles = st.builds(
    Rectangle, st.integers(0, 4), st.integers(0, 4), st.integers(1, 9), st.integers(1, 9)
)


def test_turning_points_of_expanding_squares():
    """Turned by 45 degrees, the spacing is a diagonal, so that they are centres of cells again."""
    corners = [(5, 5), (6, 4), (7, 5), (5, 7), (3, 5), (6, 2), (9, 5), (5, 9)]
    assert np.allclose(expanding_square((5, 5), 7, heading=45), corners)


def test_sectors_are_equilateral_triangles_with_the_datum_in_common():
    legs = np.diff(sector_search((10, 10), 6, heading=30), axis=0)
    headings = np.degrees(np.arctan2(legs[:, 0], -legs[:, 1])) % 360
    assert np.allclose(np.hypot(*legs.T), 6)
    assert np.allclose(headings, [30, 150, 270, 270, 30, 150, 150, 270, 30])


class TestParallelLegs:
    @settings(max_examples=40, derandomize=True)
    @given(rectangles, st.booleans(), st.data())
    def test_visit_every_cell_once(self, area, along_x, data):
        corner = data.draw(st.sampled_from(area.corners))
        points = parallel_track(area, along_x, corner)
        cells = cells_along(points, 20)
        assert cells[0] == corner
        assert len(cells) == area.area and set(cells) == cells_of(area)
        assert all(adjacent(a, b) for a, b in pairwise(cells))
        legs = list(zip(points[::2], points[1::2], strict=True))
        assert len(legs) == (area.height if along_x else area.width)
        for (ax, ay), (bx, by) in legs:
            assert (ay if along_x else ax) == pytest.approx(by if along_x else bx, abs=1e-9)
        for (_, end), (start, _) in pairwise(legs):
            assert math.dist(end, start) == pytest.approx(1)

    @settings(max_examples=40, derandomize=True)
    @given(rectangles, st.integers(1, 12), st.booleans())
    def test_strips_divide_all_cells_as_evenly_as_whole_legs_allow(self, area, count, along_x):
        parts = strips_of(area, count, along_x)
        assert len(parts) == min(count, area.area)
        assert Counter(cell for part in parts for cell in cells_of(part)) == Counter(cells_of(area))
        legs, length = (area.height, area.width) if along_x else (area.width, area.height)
        if count <= legs:
            areas = [part.area for part in parts]
            assert max(areas) - min(areas) <= length
            assert all((p.width if along_x else p.height) == length for p in parts)


class TestCells:
    points = st.tuples(st.floats(-5, 14), st.floats(-5, 14))

    @settings(max_examples=50, derandomize=True)
    @given(
        st.tuples(st.integers(0, 9), st.integers(0, 9)),
        st.tuples(st.integers(0, 9), st.integers(0, 9)),
    )
    def test_a_leg_is_a_staircase_close_to_the_line(self, start, end):
        cells = cells_along([start, end], 10)
        assert (cells[0], cells[-1]) == (start, end)
        assert len(cells) == abs(end[0] - start[0]) + abs(end[1] - start[1]) + 1
        assert all(adjacent(a, b) for a, b in pairwise(cells))
        across = end[0] - start[0]
        down = end[1] - start[1]
        for x, y in cells:
            off = abs((x - start[0]) * down - (y - start[1]) * across)
            assert off <= 0.75 * (math.hypot(across, down) or 1)

    @settings(max_examples=50, derandomize=True)
    @given(st.lists(points, min_size=1, max_size=6))
    def test_cells_outside_the_grid_and_immediate_repetitions_are_omitted(self, points):
        whole = cells_along([(x + 10, y + 10) for x, y in points], 40)
        here = cells_along(points, 10)
        assert set(here) == {(x - 10, y - 10) for x, y in whole} & cells_of(Rectangle(0, 0, 10, 10))
        assert all(a != b for a, b in pairwise(here))


class TestDatum:
    def test_hypotheses_that_overlap_share_a_datum(self):
        """Left and right of the wind: the datum is the mean, between the two."""
        drifts = [
            Drift((20, 20), vector=(side * 0.1, 0.2), diffusion=0.2, weight=weight)
            for side, weight in ((-1, 3.0), (1, 1.0))
        ]
        (datum,) = datums_of(ProbabilityMatrix(40, Person(drifts)), 20)
        assert datum.weight == 1.0
        assert datum.mean == pytest.approx((19, 24), abs=0.1)
        # The law of total variance along x.
        assert datum.deviation == pytest.approx((math.sqrt(4 + 2**2 * 3 / 4), 2.0), rel=0.05)

    def test_hypotheses_are_joined_by_others_between_them(self):
        cells = [(5, 20), (33, 20), (12, 20), (26, 20), (19, 20)]
        drifts = [Drift(cell, diffusion=0.5) for cell in cells]
        forecast = ProbabilityMatrix(40, Person(drifts))
        assert len(datums_of(forecast, 2)) == 5
        assert len(datums_of(forecast, 12)) == 1
        without_the_middle = ProbabilityMatrix(40, Person(drifts[:-1]))
        assert len(datums_of(without_the_middle, 12)) == 2

    @settings(max_examples=50, derandomize=True)
    @given(
        st.tuples(st.floats(0, 11), st.floats(0, 11)),
        st.tuples(st.floats(0, 8), st.floats(0, 8)),
        st.floats(1, 150),
    )
    def test_area_contains_the_datum_and_is_within_the_grid_and_the_effort(
        self, mean, spread, cells
    ):
        area = Datum(mean, spread, cells).area(12)
        assert cells_of(area) <= cells_of(Rectangle(0, 0, 12, 12))
        assert 1 <= area.area <= cells
        assert (math.floor(mean[0] + 0.5), math.floor(mean[1] + 0.5)) in cells_of(area)


def policy_for(kind: type[PatternPolicy], n_drones: int, **changes: Any) -> PatternPolicy:
    parameters = {"grid_size": 40, "n_drones": n_drones, "vector": (0.2, 0.1), **changes}
    return kind(Scenario(**parameters))


def recorded_routes(policy: PatternPolicy) -> list[tuple[Datum, list[list[list[Cell]]]]]:
    """A list that receives the datum and the routes each time the policy lays out tracks."""
    recorded = []
    routes = policy.routes

    def record(datum: Datum, passes: int) -> list[list[list[Cell]]]:
        recorded.append((datum, routes(datum, passes)))
        return recorded[-1][1]

    policy.routes = record  # type: ignore[method-assign]
    return recorded


WIDE = Datum((20.0, 18.0), (4.0, 2.0), 10_000)


@pytest.mark.parametrize("n_drones", [1, 7])
@pytest.mark.parametrize("kind", [ParallelSweepPolicy, CreepingLinePolicy])
def test_sweeping_drones_visit_every_cell_of_the_area_once_together(kind, n_drones):
    tracks = policy_for(kind, n_drones).routes(WIDE, 0)
    assert len(tracks) == n_drones
    for routes in tracks:
        assert len({frozenset(route) for route in routes}) == 1, "alternatives have the same cells"
    once = Counter(cell for routes in tracks for cell in routes[0])
    assert once == Counter(cells_of(Rectangle(12, 14, 17, 9)))  # two deviations to each side


@pytest.mark.parametrize(("kind", "axis"), [(ParallelSweepPolicy, 0), (CreepingLinePolicy, 1)])
@pytest.mark.parametrize("spread", [(4.0, 2.0), (2.0, 4.0)])
def test_legs_of_ps_are_along_the_longer_side_and_of_cs_along_the_shorter(kind, axis, spread):
    (routes,) = policy_for(kind, 1).routes(WIDE._replace(deviation=spread), 0)
    along = axis if spread[0] > spread[1] else 1 - axis
    moves = [b[along] != a[along] for a, b in pairwise(routes[0])]
    assert sum(moves) > len(moves) / 2


def test_the_expanding_square_is_repeated_turned_by_45_degrees():
    policy = policy_for(ExpandingSquarePolicy, 1)
    ((first,),) = policy.routes(WIDE, 0)
    ((second,),) = policy.routes(WIDE, 1)
    assert first[0] == second[0] == (20, 18)
    # Against the drift, which is mainly to the right; then by 45° further to the right.
    assert first[1] == (19, 18)
    assert first == cells_along(expanding_square((20, 18), 23, 270), 40)
    assert second[:3] in ([(20, 18), (20, 17), (19, 17)], [(20, 18), (19, 18), (19, 17)])


@pytest.mark.parametrize("kind", PATTERNS)
def test_drones_move_to_the_commence_search_point_then_search_every_cell(kind):
    env = DroneSwarmSearch(
        grid_size=20,
        vector=(0, 0),
        person_initial_position=(12, 12),
        probability_of_detection=0.0,
        timestep_limit=150,
    )
    policy = kind(env.scenario)
    laid_out = recorded_routes(policy)
    observations, _ = env.reset(0)
    flown: list[tuple[Cell, int]] = []
    while env.agents:
        actions = policy(observations)
        flown.append((observations["drone0"]["observation"][0], actions["drone0"]))
        observations, *_ = env.step(actions)
    ((*choices,),) = laid_out[0][1]
    searched = [cell for cell, action in flown if action == Action.SEARCH]
    route = next(route for route in choices if route[0] == searched[0])
    route = route[: len(searched)]  # the required time is an estimate
    assert len(route) >= 0.8 * len(choices[0])
    assert searched[: len(route)] == route
    start = next(i for i, (_, action) in enumerate(flown) if action == Action.SEARCH)
    assert start == abs(route[0][0]) + abs(route[0][1]), "the shortest path"
    ((*_, last),) = [[cell for cell, _ in flown[start : start + 2 * len(route) - 1]]]
    assert last == route[-1], "a move and a search per cell"


@settings(max_examples=6, derandomize=True)
@given(st.data(), st.sampled_from(PATTERNS))
def test_drones_never_block_each_other_permanently(data, kind):
    size = data.draw(st.integers(2, 6))
    grid = [(x, y) for y in range(size) for x in range(size)]
    n = data.draw(st.integers(1, min(8, len(grid))))
    env = DroneSwarmSearch(
        size,
        n_drones=n,
        vector=data.draw(st.sampled_from([(0, 0), (0.3, -0.2), (1, 1)])),
        person_initial_position=data.draw(st.sampled_from(grid)),
        disperse_constant=data.draw(st.sampled_from([0, 1, 20])),
        probability_of_detection=0.0,
        timestep_limit=200,
    )
    policy = kind(env.scenario)
    laid_out = recorded_routes(policy)
    observations, _ = env.reset(0, drones_positions=data.draw(st.permutations(grid))[:n])
    while env.agents:
        observations, *_ = env.step(policy(observations))
    assert len(laid_out) >= 2


def test_divides_the_time_among_hypotheses_far_apart():
    person = Person(
        [Drift((4, 4), diffusion=0.02, weight=3), Drift((15, 15), diffusion=0.02)],
        probability_of_detection=0.0,
    )
    env = DroneSwarmSearch(20, n_drones=2, persons=person, timestep_limit=150)
    policy = ParallelSweepPolicy(env.scenario)
    laid_out = recorded_routes(policy)
    observations, _ = env.reset(0)
    around_first = []  # whether each search is around the first position
    while env.agents:
        actions = policy(observations)
        for name, action in actions.items():
            if action == Action.SEARCH:
                (x, y), _ = observations[name]["observation"]
                around_first.append(x + y < 19)
        observations, *_ = env.step(actions)
    assert around_first[0], "the likelier one first"
    assert around_first.count(True) >= 20 and around_first.count(False) >= 20
    (first, _), (second, _), *_ = laid_out
    assert (first.weight, second.weight) == (0.75, 0.25)
    # Two drones search a cell in two steps, after some steps to get there.
    assert 0.75 * 150 - 10 < first.effort < 0.75 * 150
