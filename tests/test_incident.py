"""Incidents: from degrees to flights that come back in time and find what they promise."""

import json
import math
import sys
import time
import warnings
from dataclasses import replace
from datetime import timedelta
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import pytest
from hypothesis import given
from hypothesis import strategies as st
from netcdf_tracks import NOON, write

from DroneSwarmSearch import Scenario, leeway
from DroneSwarmSearch.cli import main
from DroneSwarmSearch.commands.plan import summary
from DroneSwarmSearch.evaluation import evaluate
from DroneSwarmSearch.geo import (
    KNOT,
    Constant,
    Series,
    TangentPlane,
    current_towards,
    units,
    wind_from,
)
from DroneSwarmSearch.incident import (
    KINDS,
    PARALLEL,
    SECTOR,
    SQUARE,
    FlightPlan,
    Incident,
    Pattern,
    Waypoint,
    after,
    drone_in_wind,
    locate,
    search_on_grid,
    simulate,
)
from DroneSwarmSearch.incident import plan as plan_flights
from DroneSwarmSearch.incident.families import Area, Boxes
from DroneSwarmSearch.incident.flights import up_to_the_minute

pytest.importorskip("cmaes")

GEOD = pyproj.Geod(ellps="WGS84")
KNOWN: dict[str, Any] = {
    "position": (54.18, 7.85),
    "time": "2026-03-01T05:30Z",
    "object_class": "LIFE-RAFT-SB-6",
    "wind": "300 20kn",
    "current": "160 0.5kn",
}
AT_SEA = {"coast": "none"}


@pytest.fixture(scope="module")
def plan():
    return plan_flights(Incident(**KNOWN, drones=2, endurance="30 min"))


@pytest.mark.parametrize("latitude", [0.0, 54.2, -69.5, 84.0])
@pytest.mark.parametrize(("distance", "most"), [(1e3, 1e-4), (5e4, 0.6), (1e5, 4.2)])
def test_the_plane_agrees_with_the_ellipsoid(latitude, distance, most):
    longitude = 179.9
    count = 32
    plane = TangentPlane(latitude, longitude)
    azimuths = np.linspace(0, 360, count)
    there = GEOD.fwd(*np.tile([[longitude], [latitude]], count), azimuths, np.full(count, distance))
    metres = plane.metres(there[1], there[0])
    angles = np.radians(azimuths)
    expected = distance * np.stack([np.sin(angles), np.cos(angles)], axis=1)
    assert np.hypot(*(metres - expected).T).max() < most
    back = plane.degrees(metres)
    assert abs(GEOD.inv(back[:, 1], back[:, 0], there[0], there[1])[2]).max() < 1e-6


@pytest.mark.thorough
def test_north_is_north_where_the_search_is():
    """After 12 hours at 70 degrees north, the drift has turned with the meridians."""
    incident = Incident(
        position=(70, 20),
        time="2026-03-01T00:00Z",
        start="2026-03-01T12:00Z",
        object_class="PIW-6",
        wind=(20, 0),
        wind_error=0,
        current_error=0,
        position_error=50,
        endurance=60,
    )
    cloud = simulate(incident, 20_000, 0)
    hours = 12.0
    east, north = cloud.mean(hours * 3600)
    latitude, longitude = incident.plane.degrees((east, north))
    speed = leeway.CLASSES["PIW-6"].speeds(20).downwind
    there = 20.0
    here = 70.0
    for _ in range(100):  # along the parallel
        there, here, _ = GEOD.fwd(there, here, 90.0, speed * 36 * hours)
    assert GEOD.inv(there, here, longitude, latitude)[2] < 60


@pytest.mark.thorough
@pytest.mark.parametrize(
    "name", ["PIW-1", "PIW-4", "LIFE-RAFT-NB-2", "SKIFF-4", "FISHING-VESSEL-1"]
)
def test_particles_have_the_moments_of_the_leeway_model(name):
    """Without jibing to speak of: an hour adrift, against the formulas of `ObjectClass.speeds`."""
    wind = np.array([6.0, -8.0])
    hours = 0.5
    known = {"position": (0, 0), "time": NOON, "start": NOON + timedelta(hours=hours)}
    incident = Incident(
        **known,
        object_class=name,
        wind=wind,
        wind_error=0,
        current_error=0,
        position_error=0,
        endurance=60,
    )
    cloud = simulate(incident, 40_000, 0)
    east, north = cloud.at(3600 * hours).T / (3600 * hours)
    away = incident.plane.metres(0, 0) / (3600 * hours)  # the plane touches the mean
    along = (np.stack([east, north]).T - away) @ wind / 10
    right = (np.stack([east, north]).T - away) @ [-0.8, -0.6]
    speeds = leeway.CLASSES[name].speeds(10)
    walk = math.sqrt(2 * 5.0 / (3600 * hours))
    assert along.mean() == pytest.approx(speeds.downwind, abs=0.003)
    assert along.std() == pytest.approx(math.hypot(speeds.downwind_sd, walk), rel=0.02)
    side = (speeds.right - speeds.left) / 2
    assert right.mean() == pytest.approx((speeds.right + speeds.left) / 2, abs=0.005)
    spread = math.sqrt((speeds.right_sd**2 + speeds.left_sd**2) / 2 + side**2 + walk**2)
    assert right.std() == pytest.approx(spread, rel=0.03)


def test_errors_of_wind_and_current_widen_the_map():
    """A wind error moves rafts downwind by their leeway; a current error moves everything."""
    alone = {**KNOWN, **AT_SEA, "position_error": 0, "object_class": "PIW-6", "endurance": 60}
    errors = {"none": (0, 0), "current": (0, 0.3), "wind": (3, 0)}
    spread = {
        name: simulate(Incident(**alone, wind_error=wind, current_error=current), 20_000, 0)
        .at(3600)
        .std(axis=0)
        for name, (wind, current) in errors.items()
    }
    widened = np.sqrt(spread["current"] ** 2 - spread["none"] ** 2)
    assert widened == pytest.approx(0.3 * 3600, rel=0.03)
    slope = leeway.CLASSES["PIW-6"].downwind.slope / 100
    downwind, _ = np.abs(wind_from(300, 1.0))
    grown = math.sqrt(spread["wind"][0] ** 2 - spread["none"][0] ** 2)
    assert grown > 0.8 * slope * 3 * 3600 * downwind


def test_winds_and_currents_change_in_time():
    """A current that turns back after an hour brings persons back."""
    tide = {0: (0.5, 0.0), 3600: (0.5, 0.0), 3601: (-0.5, 0.0)}
    still = {**KNOWN, **AT_SEA, "wind": (0, 0), "wind_error": 0, "current_error": 0}
    still["endurance"] = 3600
    there = Incident(**{**still, "current": tide, "object_class": "PIW-1"})
    cloud = simulate(there, 20_000, 0)
    assert cloud.mean(7200)[0] - cloud.mean(3600)[0] == pytest.approx(-1800, abs=20)


def test_flows_are_read_as_they_are_typed(tmp_path):
    (tmp_path / "wind.csv").write_text(
        "time, direction, speed\n2026-03-01T05:30Z, 300, 25kn\n2026-03-01T08:00Z, 320, 30 kn\n"
    )
    first = wind_from(300, 25 * KNOT)
    second = wind_from(320, 30 * KNOT)
    series = {0.0: first, 9000.0: second}
    for typed, expected in (
        ("300 25kn", first),
        ("300° 25 kt", first),
        (["300 25kn"], first),
        (["300 25kn", "320 30kn@08:00Z"], series),
        (["320 30kn@2026-03-01T08:00Z", "300 25kn"], series),
        ({0: first, 9000: "320 30 kn"}, series),
        (str(tmp_path / "wind.csv"), series),
        (["300 25kn@05:30Z", "320 30kn@04:30Z"], {-3600.0: second, 0.0: first}),  # an hour before
    ):
        wind = Incident(**{**KNOWN, "wind": typed}).wind
        if isinstance(expected, dict):
            assert isinstance(wind, Series) and wind.vectors == expected
        else:
            assert isinstance(wind, Constant) and wind.vector == expected
    current = Incident(**{**KNOWN, "current": "NW 1kn"}).current
    assert current.vectors_from(0.0) == {0.0: current_towards(315, KNOT)}


PATTERNS = st.builds(
    Pattern,
    kind=st.sampled_from(KINDS),
    start=st.tuples(st.floats(-3000, 3000), st.floats(-3000, 3000)).map(np.array),
    heading=st.floats(0, 2 * math.pi),
    length=st.floats(50, 5000),
    spacing=st.floats(50, 500),
    legs=st.integers(1, 20),
    side=st.sampled_from([-1, 1]),
    drift=st.tuples(st.floats(-1, 1), st.floats(-1, 1)).map(np.array),
)


@given(
    pattern=PATTERNS,
    wind=st.builds(wind_from, st.floats(0, 360), st.floats(0, 18)),
    veers=st.booleans(),
    speed=st.floats(15, 30),
    endurance=st.floats(1500, 6000),
    reserve=st.sampled_from([0.0, 300.0]),
    turn=st.floats(0, 10),
)
def test_every_leg_can_be_flown_in_the_wind_and_the_drone_returns(
    pattern, wind, veers, speed, endurance, reserve, turn
):
    later = {0: wind, 3600: wind, 4 * 3600: (-wind[1], wind[0])}
    values: dict[str, Any] = {
        "speed": speed,
        "endurance": endurance,
        "reserve": reserve,
        "turn": turn,
    }
    values["base"] = (54.21, 7.84)
    incident = Incident(**{**KNOWN, **values, "wind": later if veers else wind})
    drone = drone_in_wind(incident, 2)
    flown = drone.fly(pattern)
    if flown is None:
        return
    flight = flown.points
    base = incident.plane.metres(*incident.base)
    assert flight[[0, -1], 1:] == pytest.approx(np.array([base, base]), abs=1e-6)
    assert flight[0, 0] == 0 and flight[-1, 0] <= endurance - reserve + 1e-6
    if len(flight) > 3:  # the commence search point moves with the pattern
        assert flight[1, 1:] == pytest.approx(
            pattern.start + pattern.drift * flight[1, 0], abs=1e-6
        )
    unit = None
    for now, then in pairwise(flight):
        way = then[1:] - now[1:]
        if np.hypot(*way) < 1:
            continue
        before = unit
        unit = way / np.hypot(*way)
        turned = 0.0 if before is None else math.acos(np.clip(before @ unit, -1, 1))
        seconds = then[0] - now[0] - turned / (math.pi / 2) * turn
        is_first_or_last = now[0] == 0 or then[0] == flight[-1, 0]
        if is_first_or_last:  # it climbs or sinks
            seconds -= incident.heights[2] / incident.climb
        blows = drone.wind(np.linspace(now[0], then[0], 9), np.zeros((2, 9))).mean(axis=1)
        air = np.hypot(*(way / seconds - blows))
        # The wind is that half-way, of the whole leg where the way home cuts it short.
        assert (0.95 if veers else 0.99) * speed < air < (1.05 if veers else 1.01) * speed


@pytest.mark.parametrize("kind", KINDS)
def test_patterns_are_those_of_the_manual(kind):
    """To starboard from a first leg to the north: where the first legs end, in units of 100 m."""
    pattern = Pattern(kind, np.zeros(2), 0.0, 500.0, 100.0, 3, 1, np.zeros(2))
    half = 2.5
    wide = 5 * math.sqrt(3) / 2
    expected = {
        PARALLEL: [(0, 5), (1, 5), (1, 0), (2, 0), (2, 5), (2, 0), (1, 0), (1, 5), (0, 5), (0, 0)],
        SQUARE: [(0, 1), (1, 1), (1, -1), (-1, -1), (-1, 2), (2, 2)],
        SECTOR: [(0, 5), (wide, half), (-wide, -half), (-wide, half), (wide, -half), (0, -5)],
    }[kind]
    points = pattern.points(20) / 100
    assert points[: len(expected) + 1] == pytest.approx(np.array([(0, 0), *expected]), abs=1e-9)
    port = replace(pattern, side=-1).points(20) / 100
    assert port == pytest.approx(points * (-1, 1), abs=1e-9)


@pytest.mark.thorough
def test_drones_fly_at_heights_of_their_own_and_search_between(plan):
    assert len(plan.flights) == len(plan.orders) == 2
    for number, flight in enumerate(plan.flights):
        assert {each.altitude for each in flight} == {100 + 20 * number}
        assert flight[-1].time - flight[0].time <= timedelta(seconds=0.8 * plan.incident.endurance)
        assert [each.searching for each in flight] == [False, *[True] * (len(flight) - 2), False]
        assert 5 < len(flight) <= 45
        first = flight[0]
        scene = flight[1]
        last = flight[-1]
        for text in (
            f"Drone {number + 1}: ",
            f"commence search point {units.radioed((scene.latitude, scene.longitude))}",
            f"height {first.altitude:.0f} m, take-off 06:30, ",
            f"on scene {up_to_the_minute(scene.time):%H:%M}, ",
            f"landing {last.time:%H:%M}, ",
        ):
            assert text in plan.orders[number]


def found(plan: FlightPlan, persons: int = 20_000, seed: int = 5) -> float:
    """The share of other particles that the flights find, counted by pieces of legs."""
    incident = plan.incident
    cloud = simulate(incident, persons, seed)
    passed = np.zeros(len(cloud.weights))
    for flight in plan.flights:
        points = incident.plane.metres(
            [each.latitude for each in flight], [each.longitude for each in flight]
        )
        seconds = np.array([incident.seconds(each.time) for each in flight])
        for leg in range(1, len(flight) - 1):
            way = points[leg + 1] - points[leg]
            length = float(np.hypot(*way))
            pieces = math.ceil(length / incident.swath)
            for share in (np.arange(pieces) + 0.5) / max(pieces, 1):
                at = seconds[leg] + share * (seconds[leg + 1] - seconds[leg])
                away = cloud.at(at) - points[leg] - share * way
                along = away @ way / length
                across = away @ (way[::-1] * [1, -1]) / length
                here = np.abs(along) <= length / pieces / 2
                passed += here & (np.abs(across) <= incident.swath / 2)
    missed = (1 - incident.probability_of_detection) ** passed
    return float(cloud.weights @ (1 - missed))


@pytest.mark.thorough
@pytest.mark.good_plans
@pytest.mark.parametrize(
    "values",
    [
        {},
        {"drones": 1, "position_error": 100, "object_class": "PIW-3", "base": (54.15, 7.7)},
        {"start": "2026-03-01T09:30Z", "swath": 500, "speed": 30, "turn": 0},
    ],
    ids=str,
)
def test_simulated_persons_are_found_as_often_as_stated(values):
    plan = plan_flights(Incident(**{**KNOWN, "drones": 1, "endurance": "38 min", **values}))
    assert found(plan) == pytest.approx(plan.probability_of_success, abs=0.015)
    assert plan.success(plan.on_scene) == 0.0 < plan.success(plan.on_scene + timedelta(minutes=9))
    assert plan.success(plan.landed) == plan.probability_of_success


def test_plans_beat_a_rectangle_around_the_middle(plan):
    """Parallel tracks of a swath around the mean of the particles, the same for both drones."""
    incident = plan.incident
    pattern = plan.patterns[0]
    middle = plan.particles.mean(incident.seconds(incident.start) + incident.endurance / 2)
    usual = replace(
        pattern, start=middle - 1000, heading=0.0, length=2000.0, spacing=200.0, legs=11
    )
    missed = np.ones(len(plan.particles.weights))
    for number in range(2):
        flown = drone_in_wind(incident, number).fly(replace(usual, drift=np.zeros(2), side=1))
        assert flown is not None
        points = flown.points + [incident.seconds(incident.start), 0, 0]
        legs = np.stack([points[1:-1], points[2:]], axis=1)
        missed *= plan.particles.missed(legs, incident.craft[number])
    assert plan.probability_of_success > 1 - missed.mean() + 0.05


@pytest.mark.thorough
@pytest.mark.good_plans
def test_the_second_sortie_begins_with_the_posterior_of_the_first(plan):
    again = after(plan.incident, plan)
    assert again.start == plan.landed + timedelta(minutes=30)
    fresh = replace(again, flown=())
    seconds = again.seconds(again.start)
    prior, posterior = (simulate(each, 20_000, 0) for each in (fresh, again))
    effective = 1 / np.sum(posterior.weights**2)
    assert effective < 0.97 * len(posterior.weights), "passed particles weigh less"
    assert np.hypot(*(posterior.mean(seconds) - prior.mean(seconds))) > 20
    second = plan_flights(again)
    assert second.probability_of_success < plan.probability_of_success
    assert found(second) == pytest.approx(second.probability_of_success, abs=0.015)


@pytest.mark.thorough
def test_a_plan_says_what_a_drone_an_hour_or_the_wind_would_change():
    small = Incident(**{**KNOWN, "drones": 1, "endurance": "20 min"})
    assert plan_flights(small, seconds=0.1).alternatives == ()
    planned = plan_flights(small, seconds=0.1, with_alternatives=True)
    drone, more_time, wind = planned.alternatives
    assert [each.name for each in planned.alternatives] == [
        "One more drone",
        "Half an hour more",
        "A wind 5 kn stronger",
    ]
    assert min(drone.points, more_time.points) > 2
    assert wind.points < -1
    assert drone.sentence == f"One more drone: +{drone.points:.0f} points."


@pytest.mark.parametrize(
    ("values", "heights"),
    [
        ({"drones": 1}, [100]),
        ({"drones": 3}, [80, 100, 120]),
        ({"drones": 6}, [20, 40, 60, 80, 100, 120]),
        ({"drones": 8}, [20, 40, 60, 80, 100, 120, 20, 40]),
        ({"drones": 3, "altitude": 100}, [100, 120, 80]),
        ({"drones": 3, "altitude": 300}, [300, 280, 260]),
        ({"drones": 3, "altitude": 100, "ceiling": "150m"}, [100, 120, 140]),
        ({"drones": 2, "ceiling": "30m"}, [20, 20]),
    ],
)
def test_heights_differ_by_20_m_below_the_ceiling(values, heights):
    assert [*Incident(**{**KNOWN, **values}).heights] == heights


def test_defaults_follow_the_values_on_which_they_depend(tmp_path):
    incident = Incident(**{**KNOWN, "drones": 3, "endurance": "50 min"})
    assert (incident.reserve, incident.altitude, incident.ceiling) == (600, 80, 120)
    incident.write(tmp_path / "incident.json")
    for longer in (
        incident.changed(endurance="100 min", drones=1),
        Incident.read(tmp_path / "incident.json", endurance="100 min", drones=1),
    ):
        assert (longer.reserve, longer.altitude) == (1200, 100)
    assert incident.changed(reserve="5min").changed(endurance="100 min").reserve == 300


@pytest.mark.thorough
@pytest.mark.good_plans
def test_many_drones_share_heights_and_keep_clear_of_each_other():
    incident = Incident(**{**KNOWN, "drones": 8, "endurance": "30 min"})
    planned = plan_flights(incident, seconds=2)
    for number, flight in enumerate(planned.flights):
        assert flight[-1].time - flight[0].time <= timedelta(minutes=24, seconds=0.01)
        for other in planned.flights[:number]:
            if abs(other[0].altitude - flight[0].altitude) <= 15:
                assert distance(flight, other, incident) > 90
    text = " ".join(planned.briefing)
    assert "Drones 1 and 7 share the height of 20 m and come within " in text


@pytest.mark.thorough
def test_all_drones_that_share_a_height_are_named():
    planned = plan_flights(Incident(**{**KNOWN, "drones": 3, "ceiling": "20m"}), seconds=1)
    assert "Drones 1, 2 and 3 share the height of 20 m" in " ".join(planned.briefing)


def distance(flight: list[Waypoint], other: list[Waypoint], incident: Incident) -> float:
    """The least distance of two drones in metres, every second that both are in the air."""
    begin = max(flight[0].time, other[0].time)
    seconds = np.arange((min(flight[-1].time, other[-1].time) - begin).total_seconds())
    positions = []
    for each in (flight, other):
        when = [(point.time - begin).total_seconds() for point in each]
        points = [incident.plane.metres(point.latitude, point.longitude) for point in each]
        positions.append(
            np.array([np.interp(seconds, when, axis) for axis in np.transpose(points)])
        )
    return float(np.hypot(*(positions[0] - positions[1])).min())


@pytest.mark.good_plans
def test_adjacent_boxes_share_a_rectangle(plan):
    """Legs are parallel, boxes do not overlap, and each drone keeps to its own."""
    assert isinstance(plan.shape, Boxes) == (plan.points_more is None)
    incident = plan.incident
    area = Area(incident, simulate(incident, 2_000, 1))
    for abreast in (True, False):
        boxes = Boxes(abreast=abreast, moving=True, side=-1, parameters=np.zeros(6))
        first, second = area.boxes(boxes)
        assert first.heading == second.heading
        assert first.spacing == second.spacing
        corners = [pattern.points(2 * pattern.legs) for pattern in (first, second)]
        along = np.array([0.0, 1.0])  # heading north
        aside = np.array([-1.0, 0.0])  # to port
        axis, other = (aside, along) if abreast else (along, aside)
        ends = [(float((each @ axis).min()), float((each @ axis).max())) for each in corners]
        assert ends[1][0] - ends[0][1] == pytest.approx(first.spacing)
        sides = [((each @ other).min(), (each @ other).max()) for each in corners]
        assert sides[0] == pytest.approx(sides[1])
        frees = area.as_free(boxes)
        for number, (free, pattern) in enumerate(zip(frees, (first, second), strict=True)):
            same = area.pattern(number, free)
            assert same.points(9) == pytest.approx(pattern.points(9), abs=1e-6)


def test_the_quick_plan_is_done_in_seconds():
    incident = Incident(**{**KNOWN, "drones": 3})
    begin = time.process_time()
    quick = plan_flights(incident, seconds=0.5)
    assert isinstance(quick.shape, Boxes)
    assert time.process_time() - begin < 20  # on any machine
    with pytest.raises(ValueError, match="seconds must be a finite number above 0, got 0"):
        plan_flights(incident, seconds=0)


@pytest.mark.thorough
def test_a_late_take_off_costs_what_persons_elsewhere_say(plan):
    zero, *later = plan.delays
    assert zero == (0, 0.0)
    assert [delay.minutes for delay in later] == [5, 10, 15, 20, 25, 30]
    ten = timedelta(minutes=10)
    late = [[point._replace(time=point.time + ten) for point in flight] for flight in plan.flights]
    cost = found(replace(plan, flights=tuple(late)), seed=6) - found(plan, seed=6)
    assert plan.delays[2].points == pytest.approx(100 * cost, abs=1.5)
    (sentence,) = (
        each for each in plan.briefing if each.startswith("Holds for take-offs at 06:30")
    )
    points = round(-plan.delays[2].points)
    cost_in_words = f"costs {points} point" if points > 0 else "costs nothing"
    assert f"a delay of ten minutes {cost_in_words}" in sentence


def test_the_summary_fits_a_screen(plan):
    lines = summary(plan)
    assert max(map(len, lines)) <= 80
    text = " ".join(lines)
    for part in (plan.incident.sentence, "PROBABILITY OF SUCCESS ", *plan.orders, "Assumed: The"):
        assert part in text


def test_an_incident_survives_its_file(plan, tmp_path):
    file = tmp_path / "incident.json"
    tide = ["90 0.5kn", "270 0.25kn@06:30Z"]
    typed = ("54-10.8N", "007-51.0E")
    for incident in (
        plan.incident,
        Incident(**{**KNOWN, "current": tide, "position": typed}),
        after(plan.incident, plan),
    ):
        incident.write(file)
        assert Incident.read(file) == incident
    moved = Incident.read(file, position=(54.3, 7.9))
    assert moved.position == (54.3, 7.9) and (moved.base == moved.position) == (
        incident.base == incident.position
    )
    Incident(**{**KNOWN, "current": tide, "position": typed}).write(file)
    values = json.loads(file.read_text("utf-8"))
    assert values["position"] == [*typed]
    assert values["wind"] == "300° 20 kn"
    assert values["current"] == ["90° 0.5 kn@2026-03-01T05:30Z", "270° 0.25 kn@2026-03-01T06:30Z"]
    assert "base" not in values, "so that it moves with the position"


@pytest.mark.thorough
def test_tracks_take_the_place_of_class_and_current(tmp_path):
    rng = np.random.default_rng(0)
    times = 120
    start = np.array([179.99, 10.0]) + rng.normal(0, 0.01, (2000, 1, 2))
    degrees = start + np.linspace(0, 0.02, times)[:, None] * [1, 0.5]
    degrees[..., 0] = (degrees[..., 0] + 180) % 360 - 180
    path = write(tmp_path / "tracks.nc", degrees, seconds=np.arange(times) * 60.0)
    incident = Incident(
        tracks=path, start=NOON + timedelta(minutes=20), speed=15, drones=1, night=True
    )
    plan = plan_flights(incident)
    assert incident.time == NOON
    assert incident.position == pytest.approx((10, 179.99), abs=0.002)
    assert len(plan.particles.weights) == 1000, "the other half chose the pattern"
    metres = plan.particles.mean(3600) - plan.particles.mean(1800)
    assert metres == pytest.approx(np.array([1.0, 0.5]) * 0.02 * 30 / 119 * 110_000, rel=0.02)
    assert 0.2 < plan.probability_of_success < 1
    incident.write(tmp_path / "elsewhere" / "incident.json")
    again = Incident.read(tmp_path / "elsewhere" / "incident.json")
    assert Path(again.tracks).samefile(path)
    with warnings.catch_warnings():  # a position that is not near all tracks is no mistake
        warnings.simplefilter("error")
        simulate(replace(incident, position=(10.02, 179.99)), 100, 0)
    windy = drone_in_wind(replace(incident, wind="90 8m/s"), 0).wind(np.zeros(1), np.zeros((2, 1)))
    assert windy.ravel() == pytest.approx([-8 * 10**0.11, 0]), "on the drone only"
    with pytest.raises(ValueError, match="object_class cannot be given together with tracks"):
        Incident(tracks=path, object_class="PIW-1")
    degrees[::5, 60:] = np.nan
    write(path, degrees, seconds=np.arange(times) * 60.0)
    with pytest.raises(ValueError, match="must lose at most 10% of its elements before the last"):
        simulate(Incident(tracks=path, start=NOON + timedelta(minutes=20)), 100, 0)


def test_files_of_tracks_may_have_any_name(tmp_path):
    path = write(tmp_path / "tracks.oil", [[(4.8, 60.0)] * 120] * 20, seconds=np.arange(120) * 60.0)
    incident = Incident(tracks=path)
    incident.write(tmp_path / "elsewhere" / "incident.json")
    assert Incident.read(tmp_path / "elsewhere" / "incident.json").position == incident.position


@pytest.mark.thorough
def test_the_search_on_a_grid_has_the_particles_as_tracks():
    incident = Incident(**KNOWN)
    search = search_on_grid(incident)
    scenario = search.scenario
    metres = search.scale.metres_per_cell
    assert isinstance(scenario, Scenario) and scenario.n_drones == 3 and metres == 200
    (person,) = scenario.persons
    assert person.probability_of_detection == 0.8
    cells = person.drift.tracks.positions
    assert ((cells > 0) & (cells < scenario.grid_size - 1)).all(axis=2).mean() > 0.98
    first = incident.seconds(incident.start)
    degrees = locate(incident, cells[0].mean(axis=0))
    mean = simulate(incident, 10_000, 0).mean(first)
    assert np.hypot(*(incident.plane.metres(*degrees) - mean)) < 100
    assert evaluate("greedy-posterior", search, episodes=1).success.value > 0.3
    wide = search_on_grid(Incident(**{**KNOWN, "swath": 30}))
    size = wide.scale.metres_per_cell / 30
    assert size == round(size) > 1
    assert wide.scenario.persons[0].probability_of_detection == pytest.approx(0.8 / size)


def test_a_missing_package_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "cmaes", None)
    with pytest.raises(ImportError, match=r"needs the package cmaes: pip install .*\[plan\]"):
        plan_flights(Incident(**KNOWN))


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"position": (179.2, -16.5)}, "position must be (latitude, longitude) in degrees, the la"),
        ({"position": "54-70N 7-51E"}, "position: degrees are such as 54.18, 54-10.8N or"),
        ({"base": (7.85, 54.18)}, "base must be within 100 km of position, got (7.85, 54.18), far"),
        (
            {"wind": (0.0, 300.0)},
            "wind must be at most 60 m/s fast, got 300 m/s; 1 kn is 0.514 m/s",
        ),
        ({"wind": {0: (1, 2), 3600: (0, 77)}}, "wind[3600] must be at most 60 m/s fast, got 77"),
        ({"wind": "300 25"}, "wind, such as 300 25kn: a number and a unit (kn, kt"),
        ({"wind": "25kn"}, "wind, such as 300 25kn: a direction is degrees"),
        ({"wind": "no.csv"}, "wind must name a file, but there is no 'no.csv'"),
        ({"current": __file__[:-3] + ".nc"}, "current must name a file, but there is no"),
        ({"wind": None}, "wind must be given, such as 300 25kn, or tracks in its place"),
        ({"object_class": None}, "object_class must be given, such as PIW-1, a person in the"),
        ({"current": (9, 0)}, "current must be at most 5 m/s fast"),
        ({"time": "2026-03-01T05:30"}, "time must be a time with a zone, such as"),
        ({"time": "yesterday"}, "time must be a time with a zone, such as"),
        ({"object_class": "RAFT"}, "object_class must be a key of leeway.CLASSES, got 'RAFT'; the"),
        ({"start": "2026-03-01T05:00Z"}, "start must not be before time"),
        ({"base": (54.9, 7.85)}, "endurance must leave time to search, got 36 minutes without the"),
        ({"wind": "300 60kn"}, "speed must exceed the headwind, 38.8 m/s at the height"),
        ({"drones": 0}, "drones must be an integer from 1 to 50, got 0"),
        ({"probability_of_detection": 1.2}, "probability_of_detection must be a finite number"),
        ({"endurance": "45"}, "endurance: a number and a unit (h, hr, hrs, hour, hours, min"),
        ({"speed": "0 kn"}, "speed must be above 0 and at most 200 m/s, got '0 kn'"),
        ({"wind_error": -1}, "wind_error must be from 0 to 60 m/s, got -1"),
        ({"reserve": 2700}, "reserve must be less than the endurance, 45 min, got 2700"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(values, message):
    with pytest.raises(ValueError, match=r"\.|.") as caught:
        plan_flights(Incident(**{**KNOWN, **values}))
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


def test_faults_of_a_file_are_told_from_those_of_options(tmp_path, capsys):
    def errors(*options: str) -> str:
        with pytest.raises(SystemExit, match="2"):
            main(["plan", "--incident", str(path), "--out", str(tmp_path / "plan"), *options])
        return capsys.readouterr().err

    path = tmp_path / "incident.json"
    Incident(**KNOWN).write(path)
    assert "error: --drones must be an integer from 1 to 50, got 0" in errors("--drones", "0")
    path.write_text(path.read_text("utf-8").replace('"drones": 3', '"drones": 99'), "utf-8")
    assert f"{path} must be the file of an incident: drones must be" in errors("--turn", "5")
    path.write_text("[]", "utf-8")
    assert f"{path} must be the file of an incident: " in errors("--drones", "2")
