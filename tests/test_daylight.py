"""No search after sunset, unless a drone is one for the night."""

import math
from datetime import datetime, timedelta, timezone
from itertools import pairwise

import pytest

from DroneSwarmSearch.cli import main
from DroneSwarmSearch.geo.sun import is_light, next_sunrise, seconds_of_light
from DroneSwarmSearch.incident import Incident, plan

pytest.importorskip("cmaes")
pytest.importorskip("astral")

pytestmark = pytest.mark.thorough

DAY = 86_400.0
LONDON = (51.5074, -0.1278)


def utc(*parts: int) -> datetime:
    return datetime(*parts, tzinfo=timezone.utc)


@pytest.mark.parametrize(
    ("position", "noon", "sunset"),
    [
        (LONDON, utc(2026, 6, 21, 12), utc(2026, 6, 21, 20, 21)),
        (LONDON, utc(2026, 12, 21, 12), utc(2026, 12, 21, 15, 53)),
        ((0.0, 0.0), utc(2026, 3, 20, 12), utc(2026, 3, 20, 18, 11)),
        ((-33.87, 151.21), utc(2026, 12, 22, 2), utc(2026, 12, 22, 9, 5)),
    ],
)
def test_the_sun_sets_as_in_almanacs(position, noon, sunset):
    found = noon + timedelta(seconds=seconds_of_light(position, noon, DAY))
    assert abs(found - sunset) < timedelta(minutes=2)


def test_beyond_the_polar_circle_it_does_not_set_or_rise():
    tromso = (69.65, 18.96)
    assert seconds_of_light(tromso, utc(2026, 6, 21, 12), DAY) == math.inf
    assert not is_light(tromso, utc(2026, 12, 21, 11))
    assert next_sunrise(tromso, utc(2026, 12, 21, 11)) is None


KNOWN = {
    "position": (54, 7),
    "time": "2026-03-01T15:30Z",
    "object_class": "PIW-1",
    "wind": "300 20kn",
    "coast": "none",
    "drones": 2,
    "endurance": "45 min",
    "start": "16:50Z",  # the sun sets at 17:09
}


def test_a_search_ends_when_the_sun_sets():
    incident = Incident(**KNOWN)
    sunset = incident.start + timedelta(seconds=seconds_of_light((54, 7), incident.start, 7200.0))
    assert abs(sunset - utc(2026, 3, 1, 17, 9)) < timedelta(minutes=2)
    by_day = plan(incident, seconds=1)
    for flight in by_day.flights:
        ends = [after.time for before, after in pairwise(flight) if before.searching]
        assert ends and max(ends) <= sunset
    at_night = plan(Incident(**KNOWN, night=True), seconds=1)
    assert max(flight[-1].time for flight in at_night.flights) > sunset
    assert at_night.probability_of_success > by_day.probability_of_success + 0.05


def test_drones_for_the_night_stay_when_the_others_go_home():
    fleet = [{"name": "Eye"}, {"name": "Owl", "night": "yes"}]
    known = {name: value for name, value in KNOWN.items() if name != "drones"}
    made = plan(Incident(**known, fleet=fleet), seconds=1)
    eye, owl = made.flights
    assert owl[-1].time - eye[-1].time > timedelta(minutes=5)


def test_a_take_off_in_the_dark_is_refused(capsys, tmp_path):
    dark = Incident(**{**KNOWN, "start": "17:30Z"})
    message = r"start must be by day, .* got 17:30 UTC for drone 1, when the sun is down"
    with pytest.raises(ValueError, match=message):
        plan(dark)
    assert plan(dark.changed(night=True), seconds=1).probability_of_success > 0
    options = ["--position", "54", "7", "--time", "2026-03-01T15:30Z", "--object", "PIW-1"]
    options += ["--wind", "300", "20kn", "--coast", "none", "--start", "17:30Z"]
    options += ["--seconds", "1", "--no-alternatives", "--out", str(tmp_path / "plan")]
    with pytest.raises(SystemExit):
        main(["plan", *options])
    assert "--start must be by day" in capsys.readouterr().err
    main(["plan", *options, "--night"])
    assert "PROBABILITY OF SUCCESS" in capsys.readouterr().out
