"""The map of a flight plan: what it says, where things are on it, and its files."""

import io
import re
from functools import cache
from typing import Any

import numpy as np
import pytest

from DroneSwarmSearch.geo import TangentPlane
from DroneSwarmSearch.incident import FlightPlan, Incident
from DroneSwarmSearch.incident import plan as plan_flights

pytest.importorskip("matplotlib")

from matplotlib.figure import Figure
from matplotlib.text import Text

from DroneSwarmSearch.incident.files import chart

pytestmark = pytest.mark.thorough


@cache
def planned(position: tuple[float, float], base: tuple[float, float], drones: int) -> FlightPlan:
    incident = Incident(
        position=position,
        time="2026-03-01T05:30Z",
        object_class="LIFE-RAFT-SB-6",
        wind="300 20kn",
        current="160 0.5kn",
        base=base,
        drones=drones,
        endurance=2250,
        night=True,
    )
    return plan_flights(incident)


def raft(drones: int = 3) -> FlightPlan:
    return planned((54.18, 7.85), (54.19, 7.70), drones)


@cache
def drawn(plan: FlightPlan) -> Figure:
    return chart.draw(plan, range(len(plan.flights)))


def texts(plan: FlightPlan) -> list[str]:
    return [each.get_text() for each in drawn(plan).findobj(Text)]


def test_the_title_and_the_legend_say_what_is_planned():
    plan = raft()
    shown = " ".join(" ".join(texts(plan)).split())
    for text in (
        "Life raft, shallow ballast, canopy: probability of success "
        f"{plan.probability_of_success:.0%} by 06:5",
        "wind from 300° 20 kn (10 m/s)",
        "3 drones from 06:30",
        "last known position, 05:30",
        "minutes since 06:30",
        "mean drift",
        "find 80% of those in a strip of 200 m",
        "wind to 2 m/s (3.9 kn)",
        "20 m/s (39 kn) in still air",
        plan.patterns[0].kind,
        "search point",
        " km",
        " NM",
    ):
        assert text in shown, text
    assert {"N", "50%", "90%", "drone 1", "drone 2", "drone 3", "5"} <= set(texts(plan))


def test_ticks_are_where_their_positions_are():
    plan = planned((69.9, 18.2), (69.9, 18.2), 1)
    axes: Any = drawn(plan).axes[0]
    x, y = np.mean(axes.get_xlim()), np.mean(axes.get_ylim())
    for which, ticks, labels in (
        (0, [(x, each) for each in axes.get_yticks()], axes.get_yticklabels()),
        (1, [(each, y) for each in axes.get_xticks()], axes.get_xticklabels()),
    ):
        assert 2 <= len(ticks) <= 7
        for cell, label in zip(ticks, labels, strict=True):
            degrees, minutes = re.findall(r"[\d.]+", label.get_text())
            stated = int(degrees) + float(minutes) / 60
            assert plan.incident.plane.degrees(cell)[which] == pytest.approx(stated, abs=2e-4)


@pytest.mark.parametrize("longitude", [179.965, 179.985])
def test_longitudes_change_their_letter_at_the_date_line(longitude):
    ticks = [
        each
        for each in texts(planned((-17.1, longitude), (-17.1, longitude), 1))
        if "'" in each[-3:]
    ]
    assert any(each.endswith("S") for each in ticks)
    assert {each[-1] for each in ticks if each[-1] != "S"} == {"E", "W"}
    assert any(each.startswith("180°00.0'") for each in ticks)


def test_a_place_off_the_map_has_its_distance_and_direction():
    plan = raft()
    (text,) = (each for each in texts(plan) if each.startswith("take-off,"))
    found = re.fullmatch(r"take-off, 06:30: ([\d.]+) km \(([\d.]+) NM\), (\d+)° from there", text)
    assert found is not None
    kilometres, miles, degrees = map(float, found.groups())
    way = TangentPlane(54.18, 7.85).metres(54.19, 7.70)
    assert kilometres == pytest.approx(np.hypot(*way) / 1000, abs=0.06)
    assert miles == pytest.approx(kilometres / 1.852, abs=0.06)
    assert degrees == pytest.approx(np.degrees(np.arctan2(*way)) % 360, abs=1)
    assert not any(each.startswith("last known position, 05:30:") for each in texts(plan))


def test_contours_hold_half_and_nine_tenths_of_the_probability():
    plan = raft()
    axes: Any = drawn(plan).axes[0]
    held = []
    incident = plan.incident
    for lines, time in zip(
        axes.collections, np.repeat([plan.on_scene, plan.landed], 2), strict=True
    ):
        places = plan.particles.at(incident.seconds(time))
        inside = np.any([path.contains_points(places) for path in lines.get_paths()], axis=0)
        held.append(plan.particles.weights @ inside)
    assert held == pytest.approx([0.5, 0.9, 0.5, 0.9], abs=0.03)


def test_tracks_differ_without_colours():
    content = io.StringIO()
    drawn(raft(4)).savefig(content, format="svg")
    dashes = set(re.findall("stroke-dasharray: ([^;]+);", content.getvalue()))
    assert len(dashes) >= 4  # those of three drones, and of the first areas


def test_the_files_are_of_one_size_and_equal_maps_make_equal_files(tmp_path):
    for folder in (tmp_path / "first", tmp_path / "second"):
        folder.mkdir()
        chart.write(raft(1), folder)
    png = (tmp_path / "first" / "map.png").read_bytes()
    assert int.from_bytes(png[16:20], "big") == 1322
    svg = (tmp_path / "first" / "map.svg").read_bytes()
    assert svg.startswith(b"<?xml")
    assert svg == (tmp_path / "second" / "map.svg").read_bytes()
