"""Incidents: from degrees to flights that come back in time and find what they promise."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_track_files import NOON, write

from DroneSwarmSearch import Drift, Person, Scenario, leeway
from DroneSwarmSearch.drift import ProbabilityMatrix
from DroneSwarmSearch.drift.belief import Belief
from DroneSwarmSearch.drift.plane import TangentPlane
from DroneSwarmSearch.incident import FlightPlan, Incident
from DroneSwarmSearch.leeway import KNOT, current_towards, wind_from

GEOD = pyproj.Geod(ellps="WGS84")
KNOWN: dict[str, Any] = {
    "position": (54.18, 7.85),
    "time": "2026-03-01T05:30Z",
    "object_class": "LIFE-RAFT-SB-6",
    "wind": wind_from(300, 25 * KNOT),
    "current": current_towards(160, 0.5 * KNOT),
}
QUICK = "greedy-posterior"


@pytest.fixture(scope="module")
def plan() -> FlightPlan:
    return Incident(**KNOWN).plan(QUICK)


# Positions.


@pytest.mark.parametrize("latitude", [0.0, 54.2, -69.5, 84.0])
@pytest.mark.parametrize(("distance", "most"), [(1e3, 1e-4), (5e4, 0.6), (1e5, 4.2)])
def test_the_plane_agrees_with_the_ellipsoid(latitude: float, distance: float, most: float) -> None:
    longitude, count = 179.9, 32
    plane, azimuths = TangentPlane(latitude, longitude), np.linspace(0, 360, count)
    there = GEOD.fwd(*np.tile([[longitude], [latitude]], count), azimuths, np.full(count, distance))
    metres = plane.metres(there[1], there[0])
    angles = np.radians(azimuths)
    expected = distance * np.stack([np.sin(angles), np.cos(angles)], axis=1)
    assert np.hypot(*(metres - expected).T).max() < most
    back = plane.degrees(metres)
    assert abs(GEOD.inv(back[:, 1], back[:, 0], there[0], there[1])[2]).max() < 1e-6


@pytest.mark.parametrize("position", [(0.0, 0.0), (54.18, 7.85), (-70.0, 179.95), (69.9, -179.99)])
def test_cells_lie_where_the_ellipsoid_has_them(position: tuple[float, float]) -> None:
    incident = Incident(**{**KNOWN, "position": position})
    corners = np.array([[0, 0], [0, 40], [40, 40], [17.5, 3.25]])
    degrees = incident.locate(corners)
    assert np.abs(incident.cell_of(*degrees.T) - corners).max() < 1e-6
    for (one, cell), (other, cell2) in combinations(zip(degrees, corners, strict=True), 2):
        metres = GEOD.inv(one[1], one[0], other[1], other[0])[2]
        assert metres == pytest.approx(200 * math.dist(cell, cell2), abs=10)
    here = incident.cell_of(*position)
    assert np.abs(here - np.rint(here)).max() < 0.2  # a cell, up to the curvature of the drift


def test_north_is_north_where_the_search_is() -> None:
    """After 12 hours at 70 degrees north, the drift has turned with the meridians."""
    incident = Incident(
        position=(70, 20),
        time="2026-03-01T00:00Z",
        start="2026-03-01T12:00Z",
        object_class="PIW-6",
        wind=(20, 0),
        position_sd=50,
        endurance=7200,
        base=(70, 20.4),
    )
    person, grid = incident.layout.person, incident.layout.grid
    speed = leeway.CLASSES["PIW-6"].speeds(20).downwind
    longitude, latitude, course = 20.0, 70.0, 90.0
    hours = (incident.layout.first - incident.time).total_seconds() / 3600
    for _ in range(100):  # along the parallel
        longitude, latitude, _ = GEOD.fwd(longitude, latitude, course, speed * 36 * hours)
    mean = np.average(
        [drift.spread(0)[0] for drift in person.drifts], axis=0, weights=person.weights
    )
    assert (
        np.abs(incident.cell_of(latitude, longitude) - mean).max() * grid.scale.metres_per_cell < 60
    )


# The search.

INCIDENTS = st.fixed_dictionaries(
    {
        "position": st.tuples(st.floats(-70, 70), st.sampled_from([-179.99, 7.0, 179.99])),
        "time": st.just("2026-03-01T00:00+01:00"),
        "object_class": st.sampled_from([*leeway.CLASSES]),
        "wind": st.builds(wind_from, st.floats(0, 360), st.floats(2, 20)),
        "current": st.builds(current_towards, st.floats(0, 360), st.floats(0, 1)),
        "position_sd": st.sampled_from([0.0, 20.0, 926.0, 3000.0]),
        "start": st.floats(600, 12 * 3600).map(
            lambda seconds: datetime(2026, 2, 28, 23, tzinfo=timezone.utc) + timedelta(0, seconds)
        ),
        "drones": st.integers(1, 4),
        "speed": st.floats(12, 30),
        "swath": st.floats(200, 600),
        "endurance": st.floats(9000, 10000),
    }
)


def share_beyond(person: Person, grid_size: int, step: int) -> float:
    """The share of the map that would be beyond the grid, if the drift went on there."""
    shares = []
    for drift in person.drifts:
        inside = 1.0
        for mean, sd in drift.spread(step).T:
            low, high = ((edge - mean) / (sd * math.sqrt(2)) for edge in (-0.5, grid_size - 0.5))
            inside *= (math.erf(high) - math.erf(low)) / 2
        shares.append(1.0 - inside)
    return float(np.average(shares, weights=person.weights))


@settings(max_examples=10)
@given(INCIDENTS)
def test_no_incident_needs_a_grid_size_and_all_drones_return(values: dict[str, Any]) -> None:
    plan = Incident(**values).plan(QUICK)
    incident, layout = plan.incident, plan.incident.layout
    size, limit = layout.grid.size, layout.limit
    assert max(share_beyond(layout.person, size, step) for step in range(0, limit, 10)) < 0.01
    for flight in plan.flights:
        for here in (flight[0], flight[-1]):
            assert (here.latitude, here.longitude) == pytest.approx(incident.base, abs=1e-6)
        seconds = np.array([each.time.timestamp() for each in flight])
        assert (np.diff(seconds) > 0).all()
        assert seconds[-1] - seconds[0] <= incident.endurance + 1e-3
        metres = metres_of(plan, flight)
        speeds = np.hypot(*np.diff(metres, axis=0).T) / np.diff(seconds)
        assert speeds.max() <= incident.speed * 1.001
    assert apart(plan) > 0.7 * layout.grid.scale.metres_per_cell
    assert min(each.time for each in plan.waypoints) >= incident.start
    assert 0 < plan.probability_of_success <= 1
    assert (np.diff(plan.success) >= -1e-12).all()


def metres_of(plan: FlightPlan, flight: Any) -> np.ndarray:
    degrees = np.array([(each.latitude, each.longitude) for each in flight])
    return plan.incident.layout.grid.plane.metres(*degrees.T)


def positions(plan: FlightPlan, seconds: np.ndarray) -> np.ndarray:
    """Of all drones at some times, in metres: (n, drones, 2); NaN on the ground."""
    every = []
    for flight in plan.flights:
        when = [each.time.timestamp() for each in flight]
        axes = metres_of(plan, flight).T
        every.append([np.interp(seconds, when, axis, np.nan, np.nan) for axis in axes])
    return np.moveaxis(every, 2, 0)


def apart(plan: FlightPlan) -> float:
    """The least distance of two drones that are not both near the base, in metres."""
    first, last = plan.waypoints[0].time, max(each.time for each in plan.waypoints)
    first = min(first, *(flight[0].time for flight in plan.flights))
    seconds = np.arange(first.timestamp(), last.timestamp(), 1.0)
    every = positions(plan, seconds)
    base = plan.incident.layout.grid.plane.metres(*plan.incident.base)
    away = np.hypot(*np.moveaxis(every - base, -1, 0)) > 1e-3
    least = np.inf
    for one, other in combinations(range(every.shape[1]), 2):
        both = away[:, one] & away[:, other]
        distances = np.hypot(*(every[:, one] - every[:, other]).T)[both]
        least = min(least, np.nanmin(distances, initial=np.inf))
    return float(least)


def test_waypoints_search_the_cells_of_the_plan(plan: FlightPlan) -> None:
    """Every second step, each drone is in the middle of the cell that the plan searches."""
    layout = plan.incident.layout
    cells = layout.grid.searched(plan.flights, layout.first)
    ended = min(flight[-2].time for flight in plan.flights)
    steps = layout.grid.scale.whole_steps((ended - layout.first).total_seconds())
    every = np.arange(0, steps, 2)
    seconds = layout.first.timestamp() + every * layout.grid.scale.seconds_per_step
    found = layout.grid.cells(positions(plan, seconds))
    assert np.abs(found - np.rint(found)).max() < 1e-3
    for step, here in zip(every.tolist(), np.rint(found).astype(int).tolist(), strict=True):
        if len(set(map(tuple, cells[step]))) == plan.incident.drones:
            assert sorted(map(tuple, here)) == cells[step]
    assert steps > 0.8 * layout.limit


def test_simulated_persons_are_found_as_often_as_forecast(plan: FlightPlan) -> None:
    """Persons on straight lines with errors of their own, seen within half a swath of a drone."""
    incident, rng, count = plan.incident, np.random.default_rng(0), 4000
    layout = incident.layout
    began = layout.first.timestamp()
    seconds = np.arange(began, max(each.time.timestamp() for each in plan.waypoints), 2.5)
    drones = positions(plan, seconds)
    speeds = leeway.CLASSES[incident.object_class].speeds(math.hypot(*incident.wind))
    downwind = np.array(incident.wind) / math.hypot(*incident.wind)
    right = np.array([downwind[1], -downwind[0]])
    is_right = rng.random(count) < 0.5
    across = np.where(
        is_right,
        rng.normal(speeds.right, speeds.right_sd, count),
        rng.normal(speeds.left, speeds.left_sd, count),
    )
    along = rng.normal(speeds.downwind, speeds.downwind_sd, count)
    velocity = along[:, None] * downwind + across[:, None] * right + np.array(incident.current)
    start = layout.grid.plane.metres(*incident.position) + rng.normal(0, 926, (count, 2))
    missed = np.ones(count)
    saw = np.zeros((incident.drones, count), bool)
    for now, here in zip(seconds, drones, strict=True):
        adrift = now - incident.time.timestamp()
        persons = start + velocity * adrift
        for drone, place in enumerate(here):
            sees = np.hypot(*(persons - place).T) <= incident.swath / 2
            missed[sees & ~saw[drone]] *= 1 - incident.probability_of_detection
            saw[drone] = sees
    assert 1 - missed.mean() == pytest.approx(plan.probability_of_success, abs=0.04)


def test_large_areas_have_cells_of_several_strips_and_less_detection() -> None:
    incident = Incident(**{**KNOWN, "start": "2026-03-01T17:30Z", "swath": 100, "drones": 2})
    layout = incident.layout
    wide = layout.grid.scale.metres_per_cell / 100
    assert wide == round(wide) > 1
    assert layout.person.probability_of_detection == pytest.approx(0.8 / wide)
    assert apart(incident.plan(QUICK)) > 0.7 * layout.grid.scale.metres_per_cell


# The second sortie.


def test_the_second_sortie_begins_with_the_posterior_of_the_first(plan: FlightPlan) -> None:
    incident = plan.incident
    again = plan.incident.after(plan, incident.start + timedelta(hours=1))
    layout = again.layout
    step = plan.incident.layout.grid.scale.whole_steps((layout.first - plan.first).total_seconds())
    expected, matrix = plan.posterior(step), layout.person.model(layout.grid.size).exact(0)

    def moments(incident: Incident, matrix: np.ndarray) -> np.ndarray:
        y, x = np.indices(matrix.shape)
        degrees = incident.locate(np.stack([x, y], axis=-1))
        metres = TangentPlane(*KNOWN["position"]).metres(degrees[..., 0], degrees[..., 1])
        mean = np.tensordot(matrix, metres, 2)
        return np.array([mean, np.sqrt(np.tensordot(matrix, (metres - mean) ** 2, 2))])

    assert np.abs(moments(again, matrix) - moments(incident, expected)).max() < 60
    prior = plan.prior(step)
    assert np.abs(moments(incident, prior) - moments(incident, expected)).max() > 200
    alone = replace(incident, start=again.start).plan(QUICK).probability_of_success
    assert again.plan(QUICK).probability_of_success < 0.8 * alone


def test_searched_persons_have_the_posterior_of_earlier_searches() -> None:
    drifts = [Drift((6, 7), start_sd=1.5, vector=(0.2, 0.1), diffusion=0.05, adrift=3)]
    drifts.append(Drift((8, 8), start_sd=2.0, vector=(-0.1, 0.1), vector_sd=0.02, adrift=3))
    person = Person(drifts, probability_of_detection=0.7)
    earlier = [[(6, 7), (8, 8)], [], [(7, 7)], []]
    belief = Belief(model := ProbabilityMatrix(15, person), 0.7, model.joint(0))
    for step, cells in enumerate(earlier):
        belief = belief.after_search([y * 15 + x for x, y in cells]).after_drift(step)
    searched = replace(person, searched=earlier)
    np.testing.assert_allclose(searched.model(15).exact(0), belief.map(), atol=1e-15)
    later = belief.after_drift(4).after_drift(5).map()
    np.testing.assert_allclose(searched.model(15).exact(2), later, atol=1e-15)
    assert searched.vector == person.vector
    assert Person.from_dict(json.loads(json.dumps(searched.to_dict()))) == searched
    assert searched.key != person.key
    scenario = Scenario(15, persons=[searched])
    assert Scenario.from_dict(json.loads(json.dumps(scenario.to_dict()))) == scenario
    with pytest.raises(ValueError, match=r"persons\[0\].searched\[0\] must be a cell"):
        Scenario(7, persons=[searched])


# Files, tracks and errors.


def test_an_incident_survives_its_file(plan: FlightPlan, tmp_path: Path) -> None:
    tide = {0: (0.3, 0.1), 3600: (-0.2, 0.0)}
    for incident in (
        plan.incident,
        Incident(**{**KNOWN, "current": tide}),
        plan.incident.after(plan),
    ):
        incident.save(tmp_path / "incident.json")
        assert Incident.read(tmp_path / "incident.json") == incident


def test_tracks_take_the_place_of_class_wind_and_current(tmp_path: Path) -> None:
    rng, times = np.random.default_rng(0), 120
    start = np.array([179.99, 10.0]) + rng.normal(0, 0.01, (500, 1, 2))
    degrees = start + np.linspace(0, 0.02, times)[:, None] * [1, 0.5]
    degrees[..., 0] = (degrees[..., 0] + 180) % 360 - 180
    path = write(tmp_path / "tracks.nc", degrees, seconds=np.arange(times) * 60.0)
    incident = Incident(tracks=path, start=NOON + timedelta(minutes=20), speed=15)
    with pytest.warns(UserWarning, match="tracks are few"):
        plan = incident.plan(QUICK)
    assert incident.time == NOON
    assert incident.position == pytest.approx((10, 179.99), abs=0.002)
    assert 0.2 < plan.probability_of_success < 1
    incident.save(tmp_path / "elsewhere" / "incident.json")
    again = Incident.read(tmp_path / "elsewhere" / "incident.json")
    assert Path(again.tracks).samefile(path)
    with pytest.raises(ValueError, match="wind cannot be given together with tracks"):
        Incident(tracks=path, wind=(1, 2))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"position": (179.2, -16.5)}, "position must be (latitude, longitude) in degrees, the la"),
        ({"base": (7.85, 54.18)}, "base must be within 100 km of position, got (7.85, 54.18), far"),
        (
            {"wind": (0.0, 300.0)},
            "wind must be at most 60 m/s fast, got 300 m/s; 1 kn is 0.514 m/s",
        ),
        ({"wind": {0: (1, 2), 3600: (0, 77)}}, "wind[3600] must be at most 60 m/s fast, got 77"),
        ({"wind": None}, "object_class and wind must be given, or tracks in their place, got"),
        ({"current": (9, 0)}, "current must be at most 5 m/s fast"),
        ({"time": "2026-03-01T05:30"}, "time must be a time with a zone, such as"),
        ({"time": "yesterday"}, "time must be a time with a zone, such as"),
        ({"object_class": "RAFT"}, "object_class must be a key of leeway.CLASSES, got 'RAFT'; the"),
        ({"start": "2026-03-01T05:00Z"}, "start must not be before time"),
        ({"base": (54.9, 7.85)}, "endurance must leave time to search, got 45 minutes, of which"),
        ({"drones": 0}, "drones must be an integer from 1 to 50, got 0"),
        ({"probability_of_detection": 1.2}, "probability_of_detection must be a finite number"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=r"\.|.") as caught:
        Incident(**{**KNOWN, **values}).layout  # noqa: B018
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)
