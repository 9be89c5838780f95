"""Hypotheses of an incident: points, lines, areas, sightings; windows of time; object classes."""

import json
import math
from datetime import datetime, timedelta, timezone

import numpy as np
import pytest

from DroneSwarmSearch.cli import main
from DroneSwarmSearch.commands.plan import summary
from DroneSwarmSearch.incident import Hypothesis, Incident, after, plan, simulate

pytest.importorskip("cmaes")

FIRST = datetime(2026, 3, 1, 4, 0, tzinfo=timezone.utc)
LAST = datetime(2026, 3, 1, 5, 30, tzinfo=timezone.utc)
WEATHER = {"wind": "300 20kn", "current": "160 0.5kn", "coast": "none"}
STILL = {
    "wind": "300 0kn",
    "current": (0, 0),
    "coast": "none",
    "wind_error": 0,
    "current_error": 0,
    "object_class": "PIW-1",
}
CORNERS = "54-00N 007-00E; 54-00N 007-20E; 54-06N 007-20E; 54-06N 007-00E"


def starts(n=20_000, **values):
    """Where persons are when they begin, (n, 2), when, in seconds, and the incident."""
    incident = Incident(**{**STILL, **values}, endurance=600)
    cloud = simulate(incident, n, 0)
    return cloud.positions[:, 0].T.astype(np.float64), cloud.begun, incident


def test_a_line_is_passed_at_a_constant_speed():
    ends = ((54.0, 7.0), (54.0, 7.4))
    points, begun, incident = starts(
        line=ends, time=[FIRST, LAST], start=LAST, position_error="20m"
    )
    first, last = incident.plane.metres(*np.array(ends).T)
    shares = (points - first) @ (last - first) / ((last - first) @ (last - first))
    seconds = (LAST - FIRST).total_seconds()
    assert np.abs(shares - begun / seconds).max() < 0.06, "time and place belong together"
    assert np.histogram(shares, 10, (0, 1))[0] / len(shares) == pytest.approx(0.1, abs=0.01)


def test_in_an_area_every_place_is_as_likely():
    points, begun, incident = starts(area=CORNERS, time=LAST, start=LAST)
    assert np.all(begun == 0)
    corners = np.array([(54.0, 7.0), (54.0, 7 + 1 / 3), (54.1, 7 + 1 / 3), (54.1, 7.0)])
    low, high = np.sort(incident.plane.metres(*corners.T), axis=0)[[0, -1]]
    assert np.all((points > low - 100) & (points < high + 100))
    counts, *_ = np.histogram2d(*points.T, bins=4, range=np.stack([low, high]).T)
    assert counts / len(points) == pytest.approx(1 / 16, abs=0.006)


def test_a_flare_is_seen_in_a_bearing_at_a_distance():
    points, _, incident = starts(
        position=(54.0, 7.0),
        position_error=0,
        bearing="045",
        distance="5 NM",
        bearing_error=4,
        distance_error="0.5 NM",
        time=LAST,
        start=LAST,
    )
    away = points - incident.plane.metres(54.0, 7.0)
    far = np.hypot(*away.T)
    assert far.mean() == pytest.approx(5 * 1852, rel=0.01)
    assert far.std() == pytest.approx(0.5 * 1852, rel=0.05)
    bearings = np.degrees(np.arctan2(*away.T))
    assert bearings.mean() == pytest.approx(45, abs=0.3)
    assert bearings.std() == pytest.approx(4, rel=0.05)


@pytest.mark.parametrize(
    ("typed", "share"), [("1 NM probable", 0.5), ("1NM 95%", 0.95), ("1852 m", 1 - math.exp(-0.5))]
)
def test_errors_are_what_people_say(typed, share):
    """Of positions with a probable error, half are within it."""
    points, *_ = starts(position=(54, 7), time=LAST, start=LAST, position_error=typed)
    within = np.hypot(*points.T) < 1852
    assert within.mean() == pytest.approx(share, abs=0.01)


def test_errors_of_flows_may_be_probable_errors_too():
    known = Incident(**{**STILL, "current_error": "0.3kn probable"}, position=(54, 7), time=LAST)
    assert known.current_error == pytest.approx(0.131, abs=0.001)


def test_nobody_is_found_before_the_accident():
    """Nor does anybody drift."""
    known = {**STILL, "current": "090 2kn", "position_error": 0, "position": (54, 7)}
    incident = Incident(**known, time=[FIRST, LAST], start=LAST, endurance=600)
    cloud = simulate(incident, 20_000, 0)
    seconds = (LAST - FIRST).total_seconds()
    assert cloud.begun == pytest.approx(np.clip(cloud.begun, 0, seconds))
    assert cloud.begun.mean() == pytest.approx(seconds / 2, rel=0.02)
    drifted = cloud.at(seconds)[:, 0]
    expected = (seconds - cloud.begun) * 2 * 1852 / 3600
    assert np.corrcoef(drifted, expected)[0, 1] > 0.98
    flown = incident.seconds(FIRST) + np.array([[0.0, -3000.0, 0.0], [600.0, 3000.0, 0.0]])
    wide = 10_000.0
    swept, when = cloud.sweeps(flown[None], wide)
    assert np.all(cloud.begun[swept] <= when)


@pytest.fixture(scope="module")
def case():
    """Two hypotheses, the second one twice as likely, and of two kinds."""
    return Incident(
        **WEATHER,
        object_class="PIW-1",
        position_error="200 m",
        time=LAST,
        hypotheses=[
            {"name": "raft", "position": (54.0, 7.0), "object_class": {"LIFE-RAFT-SB-6": 1}},
            Hypothesis(
                line="54-05N 007-10E; 54-06N 007-20E",
                time=[FIRST, LAST],
                object_class={"PIW-1": 3, "PIW-4": 1},
                weight=1,
            ),
            {"position": (54.05, 7.1), "time": FIRST, "weight": 2},
        ],
        drones=2,
        endurance="30 min",
    )


def test_persons_are_shared_out_by_weight(case):
    assert [each.name for each in case.cases] == ["raft", "2", "3"]
    assert case.object_classes == ("LIFE-RAFT-SB-6", "PIW-1", "PIW-4")
    assert case.began == FIRST
    assert case.latest == LAST
    assert case.start == LAST + timedelta(hours=1)
    cloud = simulate(case, 8000, 0)
    assert np.bincount(cloud.hypotheses) / 8000 == pytest.approx([0.25, 0.25, 0.5])
    of_line = np.bincount(cloud.kinds[cloud.hypotheses == 1], minlength=3)
    assert of_line / of_line.sum() == pytest.approx([0, 0.75, 0.25], abs=0.001)
    few = np.bincount(cloud.first(2000).hypotheses) / 2000
    assert few == pytest.approx([0.25, 0.25, 0.5], abs=0.03)


@pytest.mark.thorough
def test_a_plan_states_what_it_finds_of_each_part(case):
    made = plan(case, seconds=1)
    parts = {part.name: part for part in made.parts}
    assert [*parts] == ["raft", "2", "3", "LIFE-RAFT-SB-6", "PIW-1", "PIW-4"]
    for names in (("raft", "2", "3"), ("LIFE-RAFT-SB-6", "PIW-1", "PIW-4")):
        found = sum(parts[name].weight * parts[name].probability_of_success for name in names)
        assert found == pytest.approx(made.probability_of_success)
    assert parts["raft"] == ("raft", *parts["LIFE-RAFT-SB-6"][1:]), "they are the same persons"
    text = " ".join(summary(made))
    assert made.success_by_part in text
    assert f"of raft ({parts['raft'].weight:.0%} likely)" in text


def test_an_incident_with_hypotheses_survives_its_file(case, tmp_path):
    path = tmp_path / "incident.json"
    case.write(path)
    assert Incident.read(path) == case
    assert "position" not in json.loads(path.read_text("utf-8"))
    again = Incident.read(path, position=(54, 7), time=LAST, object_class="PIW-1")
    assert [each.place.middle for each in again.cases] == [(54, 7)]


def test_an_area_is_found_from_the_folder_of_the_file(tmp_path):
    outline = [[7.0, 54.0], [7.2, 54.0], [7.2, 54.1], [7.0, 54.0]]
    area = tmp_path / "area.geojson"
    area.write_text(json.dumps({"type": "Polygon", "coordinates": [outline]}), "utf-8")
    known = Incident(**STILL, area=area, time=LAST)
    path = tmp_path / "incident.json"
    known.write(path)
    assert json.loads(path.read_text("utf-8"))["area"] == "area.geojson"
    assert Incident.read(path).origin == known.origin


@pytest.mark.thorough
def test_a_later_report_takes_the_place_of_all_hypotheses(case):
    made = plan(case, seconds=1)
    later = LAST + timedelta(hours=3)
    second = after(case, made, position=(54.1, 7.1), time=later, object_class="PIW-1")
    assert [each.place.middle for each in second.cases] == [(54.1, 7.1)]
    assert second.start == later
    third = after(case, made)
    assert third.cases == case.cases
    assert simulate(third, 2000, 0).found > 0


ONE = {**STILL, "position": (54, 7), "time": LAST}
SEVERAL = {**WEATHER, "hypotheses": [{"position": (54, 7), "time": LAST, "object_class": "PIW-1"}]}


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({**ONE, "line": "54N 7E; 54N 8E"}, "position, line or area must be given, one of them"),
        ({**STILL, "time": LAST}, "one of them, got none"),
        ({**ONE, "time": [LAST, FIRST]}, "time must be a time, or two, the earlier one first"),
        ({**ONE, "time": []}, "time must be a time, or two"),
        ({**ONE, "bearing": 45}, "distance must be given together with bearing"),
        ({**ONE, "distance_error": 45}, "bearing must be given together with distance_error"),
        ({**STILL, "time": LAST, "area": CORNERS, "bearing": 4}, "bearing needs position"),
        ({**STILL, "time": LAST, "line": "54N 7E"}, "line must be two or more positions.*got 1"),
        ({**STILL, "time": LAST, "line": "54N 7E; 54N 7E"}, "got the same position 2 times"),
        ({**STILL, "time": LAST, "area": "no.json"}, "area must be .* there is no file 'no.json'"),
        ({**STILL, "time": LAST, "area": "54N 7E; 54N 8E; 54N 9E"}, "without a surface"),
        ({**ONE, "object_class": {"PIW-1": 0}}, "weight of PIW-1 must be .* above 0"),
        ({**ONE, "object_class": [("PIW-1", 1), ("PIW-1", 2)]}, "names? each class once"),
        ({**ONE, "position_error": "3NM likely"}, "position_error: a number and a unit"),
        ({**SEVERAL, "position": (54, 7)}, "position cannot be given together with hypotheses"),
        ({**SEVERAL, "object_class": "PIW-2"}, "object_class cannot .* that all have theirs"),
        ({**WEATHER, "hypotheses": [{"time": LAST}]}, r"hypotheses\[0\]: position, line or area"),
        (
            {**WEATHER, "hypotheses": [{"place": 1}]},
            r"hypotheses\[0\] has the parameters .* got 'place'",
        ),
    ],
)
def test_what_cannot_be_is_refused(values, message):
    with pytest.raises((TypeError, ValueError), match=message):
        Incident(**values)


BASE = ["plan", "--wind", "300", "20kn", "--coast", "none", "--seconds", "1", "--no-alternatives"]
AT = ["--position", "54", "7", "--time", "2026-03-01T05:30Z"]


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("options", "words"),
    [
        ([*AT, "--object", "PIW-1:0.3", "--object", "LIFE-RAFT-SB-6:0.7"], "(30% likely)"),
        (
            ["--line", "54N 7E; 54N 7.2E", "--time", "2026-03-01T04:00Z", "05:30Z"]
            + ["--object", "PIW-1"],
            "between 54°00.0'N 007°00.0'E and",
        ),
        (["--area", CORNERS, *AT[3:], "--object", "PIW-1"], "in an area of"),
        (
            [*AT, "--bearing", "NE", "--distance", "5 NM", "--object", "PIW-1", "--error", "0m"],
            "seen 045° 5.0 NM from",
        ),
        ([*AT, "--error", "3NM probable", "--object", "PIW-1"], "The position is known to 4719 m"),
    ],
)
def test_the_command_takes_the_common_cases(options, words, tmp_path, capsys):
    main([*BASE, *options, "--drones", "1", "--out", str(tmp_path / "plan")])
    assert words in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ([*AT, "--object", "PIW-1", "--object", "PIW-2"], "--object must be CLASS:WEIGHT"),
        ([*AT, "--object", "PIW-1", "--area", CORNERS], "got --position and --area"),
        ([*AT, "--object", "PIW-1", "--time", "2026-03-01T05:30Z"], "--time: must be given once"),
        ([*AT, "--object", "PIW-1", "--line", "54N 7E"], "got --position and --line"),
        (
            [*AT, "--object", "PIW-1", "--line", "54N 7E", "--area", CORNERS],
            "got --position, --line and --area",
        ),
        ([*AT[3:], "--object", "PIW-1", "--line", "54N 7E"], "--line must be two or more"),
        ([*AT, "--object", "PIW-1", "--bearing-error", "3"], "--bearing must be given together"),
    ],
)
def test_the_command_names_the_option(options, words, tmp_path, capsys):
    with pytest.raises(SystemExit):
        main([*BASE, *options, "--out", str(tmp_path / "plan")])
    assert words in capsys.readouterr().err
    assert not (tmp_path / "plan").exists()
