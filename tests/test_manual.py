"""The plan of the IAMSAR Manual's worksheets: a case worked by hand, and what it finds."""

import math
from typing import Any

import numpy as np
import pytest

from DroneSwarmSearch import leeway
from DroneSwarmSearch.geo import KNOT
from DroneSwarmSearch.incident import Incident, after
from DroneSwarmSearch.incident import plan as plan_flights
from DroneSwarmSearch.incident.manual import (
    datums,
    optimal_search_factor,
    total_probable_error,
    worksheet,
)

pytest.importorskip("cmaes")

pytestmark = pytest.mark.thorough

MILE = 1852.0
KNOWN: dict[str, Any] = {
    "position": (54.3, 7.3),
    "time": "2026-03-01T05:30Z",
    "object_class": "LIFE-RAFT-SB-6",
    "wind": "300 20kn",
    "current": "160 0.5kn",
    "endurance": "40min",
    "drones": 3,
}


def test_the_worked_case(monkeypatch):
    """Leeway .029 U + .04 kn, 15 degrees off the wind; 5 h; errors of .3 kn; X = Y = 1 NM."""
    cos = math.cos(math.radians(15))
    sin = math.sin(math.radians(15))
    offset = 4 * KNOT  # cm/s of .04 kn
    raft = leeway.ObjectClass(
        "WORKED",
        "a raft",
        downwind=(2.9 * cos, offset * cos, 0),
        right=(2.9 * sin, offset * sin, 0),
        left=(-2.9 * sin, -offset * sin, 0),
    )
    monkeypatch.setattr(leeway, "CLASSES", {"WORKED": raft})
    incident = Incident(
        position=("6S", "106.5E"),
        time="2026-03-01T05:30Z",
        object_class="WORKED",
        wind="090 20kn",
        current="180 0.5kn",
    )
    right, left = datums(incident, 5 * 3600)
    found = []
    for east, north in (left, right):
        found += [math.hypot(east, north) / MILE, math.degrees(math.atan2(east, north)) % 360]
    assert found == pytest.approx([4.4578, 222.2, 3.4421, 240.449], rel=1e-4)
    assert math.hypot(*(left - right)) / MILE == pytest.approx(1.60468, rel=1e-4)
    error = total_probable_error(MILE, MILE, [0.3 * KNOT] * 6, 5 * 3600)
    assert error / MILE == pytest.approx(3.937, rel=1e-4)


def test_the_optimal_factor_is_the_best_square():
    """Against a fine search over squares, by counting a normal sample."""
    rng = np.random.default_rng(0)
    largest = np.abs(rng.normal(size=(200_000, 2))).max(axis=1) / math.sqrt(2 * math.log(2))
    for effort in (0.5, 2.0, 8.0, 30.0):
        factor = optimal_search_factor(effort)

        def success(half: float, effort: float = effort) -> float:
            contained = float(np.mean(largest <= half))
            return contained * (1 - math.exp(-effort / (4 * half**2)))

        best = max(success(half) for half in np.arange(0.1, 6, 0.02))
        assert success(factor) == pytest.approx(best, abs=0.005)
    assert optimal_search_factor(1) < optimal_search_factor(4) < optimal_search_factor(16)


def test_more_effort_searches_a_larger_area_more_densely():
    small = worksheet(Incident(**KNOWN))
    large = worksheet(Incident(**{**KNOWN, "drones": 9}))
    assert large.error == pytest.approx(small.error, rel=1e-6)
    assert large.radius > small.radius and large.spacing < small.spacing
    length, width = small.sides
    assert length - width == pytest.approx(small.divergence)
    assert small.coverage == pytest.approx(small.effort / (length * width))
    assert small.spacing == pytest.approx(200 * 0.8 / small.coverage)


@pytest.mark.good_plans
def test_a_plan_beats_the_manual():
    manual = plan_flights(Incident(**KNOWN), method="manual")
    ours = plan_flights(Incident(**KNOWN))
    assert ours.probability_of_success > manual.probability_of_success + 0.03
    assert "The manual's rectangle: total probable error" in " ".join(manual.briefing)
    headings = {pattern.heading for pattern in manual.patterns}
    assert len(headings) == 1 and len(manual.flights) == 3
    assert all(pattern.drift @ pattern.drift == 0 for pattern in manual.patterns)
    again = plan_flights(after(manual.incident, manual), method="manual")
    assert again.shape.before > 0.5 * manual.shape.effort
    assert 0 < again.probability_of_success < manual.probability_of_success


def test_an_unknown_method_is_refused():
    with pytest.raises(ValueError, match=r"method must be one of 'best', 'manual', got 'worst'"):
        plan_flights(Incident(**KNOWN), method="worst")
    with pytest.raises(ValueError, match="seconds cannot be given together with method 'manual'"):
        plan_flights(Incident(**KNOWN), method="manual", seconds=5)
