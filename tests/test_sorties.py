"""What was flown stays as it was flown, and flights that cannot be are refused."""

import csv
import math
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from DroneSwarmSearch.incident import FlownFlight, Incident, Waypoint, after, simulate
from DroneSwarmSearch.incident import plan as plan_flights
from DroneSwarmSearch.incident import write as write_plan
from DroneSwarmSearch.incident.flights import least_distance

pytest.importorskip("cmaes")

KNOWN: dict[str, Any] = {
    "position": (54.2, 7.8),
    "time": "2026-03-01T05:30Z",
    "object_class": "PIW-1",
    "wind": "300 10kn",
    "drones": 1,
    "endurance": "20min",
    "position_error": "300m",
    "start": "06:30Z",
}
START = datetime(2026, 3, 1, 6, 30, tzinfo=timezone.utc)


def line(
    first: datetime = START,
    legs: int = 6,
    seconds: float = 100.0,
    at: tuple[float, float] = (54.2, 7.8),
) -> list[Waypoint]:
    """Legs of 1.1 km to the north and back."""
    return [
        Waypoint(first + timedelta(seconds=seconds * n), at[0] + 0.01 * (n % 2), at[1], 100.0, True)
        for n in range(legs + 1)
    ]


def write(path: Path, flight: list[Waypoint]) -> Path:
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["drone", "time_utc", "latitude_deg", "longitude_deg", "searching"])
        for waypoint in flight:
            row = [waypoint.time.isoformat(), waypoint.latitude, waypoint.longitude]
            rows.writerow([1, *row, waypoint.searching])
    return path


@pytest.fixture
def flown(tmp_path):
    return write(tmp_path / "flown.csv", line())


def credit(incident: Incident) -> float:
    """What the flights of an incident would have found."""
    return simulate(incident, 4_000, 0).found


LATER = {
    "swath": {"swath": "60m"},
    "detection": {"probability_of_detection": 0.3},
    "wind": {"wind": "300 30kn"},
    "wind with a time": {"wind": "200 30kn@07:10Z"},
    "current": {"current": "90 2kn"},
    "speed": {"speed": "40 m/s"},
    "drones": {"drones": 3},
    "start": {"at": "08:15Z"},
    "endurance": {"endurance": "2h"},
    "base": {"base": (54.3, 7.8)},
    "turn": {"turn": 20},
    "altitude": {"altitude": 300},
}


@pytest.mark.thorough
@pytest.mark.parametrize("changes", LATER.values(), ids=LATER)
def test_what_was_flown_keeps_its_credit(flown, changes):
    incident = Incident(**KNOWN)
    usual = after(incident, flown)
    changed = after(incident, flown, **changes)
    assert credit(usual) > 0.05
    # Other steps and streams of random numbers, but the same flights in the same weather.
    assert credit(changed) == pytest.approx(credit(usual), abs=0.03)
    assert changed.flown == usual.flown
    (flight,) = changed.flown
    assert (flight.swath, flight.probability_of_detection) == (200.0, 0.8)


def test_every_sortie_keeps_its_own_figures(flown, tmp_path):
    first = after(Incident(**KNOWN), flown, swath="60m", probability_of_detection=0.3)
    second = write(tmp_path / "second.csv", line(START + timedelta(minutes=50)))
    third = after(first, second, swath="100m")
    figures = [(flight.swath, flight.probability_of_detection) for flight in third.flown]
    assert figures == [(200.0, 0.8), (60.0, 0.3)]
    third.write(tmp_path / "incident.json")
    assert Incident.read(tmp_path / "incident.json") == third
    assert third.swath == 100.0
    odd = [point._replace(time=point.time + timedelta(seconds=7.25)) for point in line()]
    windy = after(Incident(**KNOWN), write(tmp_path / "odd.csv", odd), wind="120 30kn")
    windy.write(tmp_path / "incident.json")
    assert Incident.read(tmp_path / "incident.json") == windy


def test_a_new_wind_holds_from_the_last_landing_on(flown):
    later = after(Incident(**KNOWN), flown, wind="120 30kn")
    before, now = (
        later.wind.velocity(np.array([seconds]), np.zeros((2, 1))) for seconds in (3600.0, 5000.0)
    )
    (first,) = Incident(**KNOWN).wind.vectors_from(0.0).values()
    assert before[:, 0] == pytest.approx(first)
    assert now[:, 0] == pytest.approx(-3 * np.array(before[:, 0]))
    assert "300° 10 kn (5.1 m/s) at 06:40, 120° 30 kn (15 m/s) at 06:40" in later.sentence
    later.write(flown.with_suffix(".json"))
    assert Incident.read(flown.with_suffix(".json")) == later
    with pytest.raises(ValueError, match="wind must be given for times from the last landing on"):
        after(Incident(**KNOWN), flown, wind="300 30kn@06:20Z")


@pytest.mark.thorough
def test_flights_count_where_the_new_particles_exist(flown):
    """A later report: what was flown before it found nobody of those who drift from there."""
    incident = Incident(**KNOWN)
    none = after(incident, flown, time="2026-03-01T07:00Z", position=(54.2, 7.8))
    assert credit(none) == 0.0
    assert none.start == datetime(2026, 3, 1, 7, 10, tzinfo=timezone.utc)
    some = after(incident, flown, "08:00Z", time="2026-03-01T06:35Z", position=(54.205, 7.8))
    (flight,) = some.flown
    waypoints = flight.waypoints
    half = [Waypoint(waypoints[2].time + timedelta(seconds=100), 54.2, 7.8, 100.0, True)]
    middle = Waypoint(some.time, 54.21, 7.8, 100.0, True)
    assert middle.time == waypoints[3].time
    counted = replace(some, flown=[FlownFlight(waypoints[3:], 200.0, 0.8)])
    assert half[0].time == middle.time
    assert credit(some) == pytest.approx(credit(counted), abs=1e-9)
    assert credit(some) > 0.05


def test_a_leg_that_the_report_cuts_counts_from_there(flown):
    incident = Incident(**KNOWN)
    cut = after(incident, flown, "08:00Z", time="2026-03-01T06:34:10Z")
    (flight,) = cut.flown
    *_, following = flight.waypoints[:4]
    begin = Waypoint(cut.time, (54.2 + 54.21) / 2, 7.8, 100.0, True)
    whole = FlownFlight((begin, following, *flight.waypoints[4:]), 200.0, 0.8)
    assert credit(cut) == pytest.approx(credit(replace(cut, flown=[whole])), abs=0.004)


@pytest.mark.thorough
def test_the_summary_says_which_flights_do_not_count(flown):
    incident = Incident(**KNOWN)
    plan = plan_flights(after(incident, flown, time="2026-03-01T07:00Z"))
    assert plan.earlier[0].startswith("After 1 flight that found nobody, and would have found 0%")
    assert plan.earlier[1] == "Not counted, because flown before the report of 07:00: 1."
    partly = replace(plan, incident=after(incident, flown, "08:00Z", time="2026-03-01T06:35Z"))
    assert partly.earlier[1] == "Counted only from the report of 06:35 on: 1."
    assert replace(plan, incident=incident).earlier == []


def with_row(row: int, **changes: Any) -> list[Waypoint]:
    flight = line()
    flight[row] = flight[row]._replace(**changes)
    return flight


MINUTE = timedelta(minutes=1)
IMPOSSIBLE = {
    "another ocean": (line(at=(-33.9, 151.2)), "line 2: drones can be at most .* km from their"),
    "the antipodes": (line(at=(-54.2, -172.2)), "line 2: drones can be at most"),
    "swapped coordinates": (line(at=(7.8, 54.2)), "line 2: drones can be at most"),
    "the pole": (line(at=(89.9, 0)), "line 2: drones can be at most"),
    "a fix at (0, 0)": (with_row(3, latitude=0, longitude=0), "line 5: drones can be at most"),
    "a fix at the equator": (with_row(3, latitude=0), "line 5: drones can be at most"),
    "a fix 20 km away": (with_row(3, latitude=54.4), "line 5: drones can make at most .* m/s"),
    "a year later": (line(START + timedelta(days=365)), "line 2: times must be from 2026-03-01"),
    "a year before": (line(START - timedelta(days=365)), "line 2: times must be from 2026-03-01"),
    "before the report": (line(START - 62 * MINUTE), "line 2: times must be from 2026-03-01 05:30"),
    "one waypoint": (line(legs=0), "line 2: a flight must have at least two waypoints, got 1"),
    "20 legs in 19 s": (
        line(legs=20, seconds=0.95),
        "line 3: drones can make at most .* 1,1.. m/s",
    ),
    "times that fall": (with_row(3, time=START), "line 5: time_utc must increase"),
}


@pytest.mark.parametrize(("flight", "message"), IMPOSSIBLE.values(), ids=IMPOSSIBLE)
def test_flights_that_cannot_be_are_refused(tmp_path, flight, message):
    path = write(tmp_path / "flown.csv", flight)
    incident = Incident(**KNOWN)
    with pytest.raises(ValueError, match=rf"flown\.csv, {message}"):
        after(incident, path)


def test_flights_in_a_gale_are_fast():
    fast = line(seconds=1112 / 75)  # 75 m/s over the ground
    with pytest.raises(ValueError, match=r"at most \d\d m/s, 1.5 times"):
        after(Incident(**KNOWN), _Plan([fast]))
    after(Incident(**{**KNOWN, "wind": "300 50kn"}), _Plan([fast]))


class _Plan:
    """What `after` needs of a plan."""

    def __init__(self, flights: list[list[Waypoint]]) -> None:
        self.flights = flights


GOOD = [["2026-03-01T06:30Z", 54.2, 7.8, 100, True], ["2026-03-01T06:32Z", 54.21, 7.8, 100, False]]
WRONG = {
    "no list": (3, TypeError, "flown must be a list of flights, got 3"),
    "text": ("plan.csv", TypeError, "flown must be a list of flights"),
    "one waypoint": ([GOOD[:1]], ValueError, "a flight must have at least two waypoints, got 1"),
    "no waypoint": ([[]], ValueError, "flown[0]: a flight must have at least two waypoints"),
    "a short row": ([[GOOD[0], GOOD[1][:4]]], ValueError, "flown[0]: waypoints[1] must be a wayp"),
    "NaN": ([[GOOD[0], [GOOD[1][0], float("nan"), 7.8, 0, True]]], ValueError, "latitude must be"),
    "540 degrees": ([[GOOD[0], [GOOD[1][0], 54, 540, 0, True]]], ValueError, "longitude must be a"),
    "a huge number": ([[GOOD[0], [GOOD[1][0], 54, 7, 10**400, True]]], ValueError, "altitude must"),
    "no flag": ([[GOOD[0], [*GOOD[1][:4], "no"]]], TypeError, "searching must be True or False"),
    "no time": ([[GOOD[0], [None, *GOOD[1][1:]]]], TypeError, "flown[0]: waypoints[1], time must"),
    "times that fall": ([GOOD[::-1]], ValueError, "flown[0]: waypoints[1]: times must increase"),
    "equal times": (
        [[GOOD[0], GOOD[0]]],
        ValueError,
        "flown[0]: waypoints[1]: times must increase",
    ),
    "no swath": ([{"waypoints": GOOD}], ValueError, "flown[0] must hold waypoints, swath, prob"),
    "a swath of 0": (
        [{"waypoints": GOOD, "swath": 0, "probability_of_detection": 1}],
        ValueError,
        "flown[0]: swath must be a finite number above 0, got 0",
    ),
    "an unknown key": (
        [{"waypoints": GOOD, "swath": 9, "probability_of_detection": 1, "pod": 1}],
        TypeError,
        "flown[0] has the parameters waypoints, swath, probability_of_detection, name, got 'pod'",
    ),
    "landing after the start": (
        [[GOOD[0], ["2026-03-01T06:50Z", 54.21, 7.8, 100, False]]],
        ValueError,
        "start must not be before the landing of flown[0], 2026-03-01 06:50, got 2026-03-01 06:40",
    ),
}


@pytest.mark.parametrize(("flights", "error", "message"), WRONG.values(), ids=WRONG)
def test_wrong_flown_flights_are_refused_by_name(flights, error, message):
    usual = {**KNOWN, "start": "06:40Z"}
    assert len(Incident(**usual, flown=[GOOD]).flown) == 1
    with pytest.raises(error) as refused:
        Incident(**usual, flown=flights)
    assert message in str(refused.value)


def test_the_next_take_off(flown):
    incident = Incident(**KNOWN)
    landed = START + timedelta(seconds=600)
    assert after(incident, flown).start == landed + timedelta(minutes=30)
    assert after(incident, flown, "07:15Z").start == START + 45 * MINUTE
    with pytest.raises(ValueError, match=r"^start must not be before a drone has landed, at 06:40"):
        after(incident, flown, "06:35Z")
    with pytest.raises(TypeError, match=r"changes has the parameters .* got 'swat'; did you mean"):
        after(incident, flown, swat=60)


def crew(**more):
    known = {**KNOWN, "coast": "none", "drones": 3, "endurance": "40 min"}
    return Incident(**known, **more)


@pytest.fixture(scope="module")
def sortie():
    return plan_flights(crew(), seconds=1)


@pytest.mark.thorough
def test_a_flight_that_was_broken_off_counts_to_that_time(sortie):
    whole = after(sortie.incident, sortie)
    middle = sortie.incident.start + timedelta(minutes=15)
    cut = after(sortie.incident, sortie, broke_off={2: middle, "3": f"{middle:%H:%M}Z"})
    assert [flight.landing for flight in cut.flown[1:]] == [middle, middle]
    assert cut.flown[0] == whole.flown[0]
    credits = [simulate(incident, 10_000, 0) for incident in (whole, cut)]
    assert credits[1].found < credits[0].found - 0.02
    assert credits[1].worth[0] == pytest.approx(credits[0].worth[0], abs=1e-3)
    assert math.fsum(credits[1].worth) == pytest.approx(credits[1].found)


@pytest.mark.parametrize(
    ("broke_off", "message"),
    [
        ({4: "07:00Z"}, "broke_off must name drones that have flown, 1, 2, 3, got '4'"),
        ({1: "05:00Z"}, "broke_off of 1 must be between its take-off, "),
        ({1: "never"}, "broke_off of 1 must be a time"),
    ],
)
def test_who_broke_off_has_flown(sortie, broke_off, message):
    with pytest.raises(ValueError, match=message):
        after(sortie.incident, sortie, broke_off=broke_off)


@pytest.mark.thorough
def test_those_who_have_landed_fly_while_others_still_do(sortie):
    """The first drone breaks off and is free; the flights of the others count as planned."""
    start = sortie.incident.start
    home = start + timedelta(minutes=10)
    early = after(sortie.incident, sortie, start + timedelta(minutes=14), broke_off={1: home})
    assert [drone.name for drone in early.craft] == ["1"]
    cloud = simulate(early, 10_000, 0)
    assert len(cloud.worth) == 3 and min(cloud.worth[1:]) > 0.01
    made = plan_flights(early, seconds=1)
    (flight,) = made.flights
    assert flight[0].time >= start + timedelta(minutes=14)
    flying = [each.name for each in early.flown if each.landing > early.start]
    assert flying == ["2", "3"]
    assert "Still flying, and counted as planned: 2 until " in " ".join(made.earlier)
    for other in early.flown[1:]:
        if other.waypoints[0].altitude == flight[0].altitude:
            assert least_distance(flight, other.waypoints) >= 100
    with pytest.raises(ValueError, match="start must not be before a drone has landed"):
        after(sortie.incident, sortie, start + timedelta(minutes=14))
    with pytest.raises(ValueError, match="start must not be before the landing of flown"):
        early.changed(fleet=[{"name": "2"}])


@pytest.mark.thorough
def test_the_log_has_all_flights_and_what_each_was_worth(sortie, tmp_path):
    second = plan_flights(after(sortie.incident, sortie), seconds=1)
    log = second.log
    assert [(entry.drone, entry.is_planned) for entry in log] == [
        (name, planned) for planned in (False, True) for name in "123"
    ]
    assert sum(entry.worth for entry in log) == pytest.approx(second.cumulative)
    assert sum(entry.worth for entry in log[:3]) == pytest.approx(second.particles.found)
    write_plan(second, tmp_path)
    page = (tmp_path / "log.html").read_text("utf-8")
    assert page.count("<td>flown</td>") == page.count("<td>planned</td>") == 3
    assert f"<td>{second.cumulative:.1%}</td>" in page
