"""Leeway: coefficients, velocities, and persons that drift like the full model."""

import math
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from DroneSwarmSearch import Drift, Person, Scale, geo, leeway

NAN = math.nan
INF = math.inf
SCALE = Scale(130, 13)
USUAL: dict[str, Any] = {"start": (30, 30), "wind": (6, -8), "scale": SCALE}

# For every class in a wind of 10 m/s, in m/s: the mean and the standard deviation downwind, the
# means to the right and to the left, and the standard deviation crosswind over both sides.
AT_10 = (
    ("PIW-1", 0.110, 0.107, 0.054, -0.054, 0.108),
    ("PIW-2", 0.067, 0.068, 0.015, -0.015, 0.069),
    ("PIW-3", 0.120, 0.024, 0.016, -0.016, 0.027),
    ("PIW-4", 0.182, 0.039, 0.103, -0.04, 0.073),
    ("PIW-5", 0.064, 0.051, 0.031, -0.031, 0.055),
    ("PIW-6", 0.214, 0.030, 0.043, -0.043, 0.059),
    ("LIFE-RAFT-DB-10", 0.327, 0.061, 0.032, -0.047, 0.053),
    ("LIFE-RAFT-DB-18", 0.318, 0.054, 0.016, -0.033, 0.035),
    ("LIFE-RAFT-DB-21", 0.088, 0.025, 0.018, -0.018, 0.030),
    ("LIFE-RAFT-SB-6", 0.268, 0.120, 0.11, -0.11, 0.145),
    ("LIFE-RAFT-SB-9", 0.168, 0.024, 0.024, -0.024, 0.034),
    ("LIFE-RAFT-NB-1", 0.370, 0.120, 0.198, -0.198, 0.219),
    ("LIFE-RAFT-NB-2", 0.633, 0.098, 0.236, -0.236, 0.253),
    ("LIFE-RAFT-NB-4", 0.339, 0.024, 0.149, -0.149, 0.151),
    ("USCG-RESCUE", 0.248, 0.038, 0.032, -0.032, 0.047),
    ("AVIATION-1", 0.339, 0.024, 0.149, -0.149, 0.151),
    ("LIFE-CAPSULE", 0.352, 0.019, 0.144, -0.144, 0.145),
    ("PERSON-POWERED-VESSEL-1", 0.227, 0.041, 0.041, -0.041, 0.060),
    ("PERSON-POWERED-VESSEL-2", 0.193, 0.083, 0.051, -0.051, 0.084),
    ("PERSON-POWERED-VESSEL-3", 0.275, 0.025, 0.056, -0.056, 0.063),
    ("SKIFF-1", 0.315, 0.022, 0.129, -0.129, 0.131),
    ("SKIFF-3", 0.165, 0.031, 0.039, -0.039, 0.049),
    ("SKIFF-4", 0.386, 0.039, 0.071, -0.071, 0.092),
    ("SPORT-BOAT", 0.654, 0.030, 0.219, -0.219, 0.221),
    ("FISHING-VESSEL-1", 0.247, 0.120, 0.276, -0.276, 0.292),
    ("FISHING-VESSEL-6", 0.363, 0.033, 0.161, -0.161, 0.164),
    ("SAILBOAT-5", 0.523, 0.185, 0.589, -0.609, 0.628),
    ("FV-DEBRIS", 0.197, 0.083, 0.036, -0.036, 0.076),
    ("CONTAINER-1", 0.192, 0.030, 0.003, -0.003, 0.023),
    ("REFUGEE-RAFT-1", 0.239, 0.015, 0.035, -0.035, 0.038),
)


def crosswind(speeds: leeway.LeewaySpeeds) -> tuple[float, float]:
    """The mean and the standard deviation over both sides of the wind."""
    mean = (speeds.right + speeds.left) / 2
    squares = speeds.right**2 + speeds.right_sd**2, speeds.left**2 + speeds.left_sd**2
    return mean, math.sqrt(sum(squares) / 2 - mean**2)


@pytest.mark.parametrize("row", AT_10, ids=[row[0] for row in AT_10])
def test_coefficients_give_the_published_velocities(row):
    name, downwind, downwind_sd, right, left, cross_sd = row
    speeds = leeway.CLASSES[name].speeds(10)
    expected = (downwind, downwind_sd, right, left, cross_sd)
    got = (speeds.downwind, speeds.downwind_sd, speeds.right, speeds.left, crosswind(speeds)[1])
    assert got == pytest.approx(expected, abs=6e-4)  # the figures have three digits


def test_the_data_file_and_the_classes_name_their_source():
    assert [row[0] for row in AT_10] == list(leeway.CLASSES)
    path = Path(leeway.__file__).with_name("leeway_classes.csv")
    assert "CG-D-08-99" in path.read_text("utf-8")
    for name, kind in leeway.CLASSES.items():
        assert kind.name == name and kind.description and "CG-D-08-99" in kind.source
        assert kind.right.slope >= 0 > kind.left.slope


@settings(max_examples=30)
@given(st.floats(-3, 5), st.floats(-10, 10), st.floats(0, 15), st.floats(0, 30))
def test_the_truncated_normal_distribution(slope, offset, sd, wind):
    """Mean and standard deviation against numerical integration over e."""
    kind = leeway.ObjectClass("A", "", (slope, offset, sd), (1, 0, 1), (-1, 0, 1))
    assume(sd > 0.01 and slope > -0.1 * sd)  # otherwise all of the mass is in the far tail
    error = np.linspace(max(-10 * sd, -20 * slope), 10 * sd, 20001)
    density = np.exp(-0.5 * (error / sd) ** 2)
    density /= density.sum()
    values = ((slope + error / 20) * wind + offset + error / 2) / 100
    mean = density @ values
    speeds = kind.speeds(wind)
    assert speeds.downwind == pytest.approx(mean, abs=1e-3)
    assert speeds.downwind_sd == pytest.approx(math.sqrt(density @ (values - mean) ** 2), abs=1e-3)


def test_a_class_without_errors_has_one_velocity():
    kind = leeway.ObjectClass("drifter", "", (3, 1, 0), (1, 0, 0), (-1, 0, 0))
    assert kind.speeds(10) == pytest.approx((0.31, 0, 0.1, 0, -0.1, 0))
    against = leeway.ObjectClass("drifter", "", (-3, 1, 1e-300), (1, 0, 0), (-1, 0, 0))
    assert against.speeds(10)[:2] == pytest.approx((0.31, 0))  # its error is drawn until it is not


def test_right_and_left_of_the_wind():
    """In a wind to the north, right is east; y grows to the south."""
    right, left = leeway.person("PIW-4", start=(30, 30), wind=(0, 10), scale=SCALE).drift.drifts
    assert right.vector == pytest.approx((0.0103, -0.0182), abs=1e-4)
    assert left.vector == pytest.approx((-0.00395, -0.0182), abs=1e-4)
    assert right.weight == left.weight == 0.5
    assert right.vector_sd == pytest.approx((0.00171, 0.00393), abs=1e-5)


def test_a_calm_leaves_the_current_alone():
    person = leeway.person("PIW-1", start=(30, 30), wind=(0, 0), current=(0.5, 1), scale=SCALE)
    vector = SCALE.vector((0.5, 1))
    assert person == Person(Drift((30, 30), vector=vector, diffusion=SCALE.diffusion(5)))


def test_metres_and_seconds_become_cells_and_steps():
    changes = {"start": (-3.5, 70), "position_sd": 260, "diffusivity": 2, "adrift": 3600}
    person = leeway.person("PIW-1", **{**USUAL, **changes}, probability_of_detection=0.8)
    assert person.probability_of_detection == 0.8
    for drift in person.drift.drifts[:2]:  # the others have jibed
        assert drift.start == (-3.5, 70) and drift.start_sd == (2.0, 2.0)
        leeway_diffusion = 0.04 * math.hypot(*drift.vector)
        assert drift.diffusion == pytest.approx(4 * 13 / 130**2 + leeway_diffusion)
    assert {drift.adrift for drift in person.drift.drifts} == {277}


def drifted(kind, wind_at, hours, rate, count):
    """Positions (east, north) in metres of objects of the full model, in steps of six minutes."""
    rng = np.random.default_rng(7)
    errors = rng.normal(size=(2, count))  # for life
    positions = np.zeros((count, 2))
    on_left = rng.random(count) < 0.5
    for time in np.arange(0.05, hours, 0.1):
        wind = np.array(wind_at(time))
        downwind = wind / math.hypot(*wind)
        speeds = kind.speeds(math.hypot(*wind))
        along = speeds.downwind + speeds.downwind_sd * errors[0]
        across = np.where(
            on_left,
            speeds.left + speeds.left_sd * errors[1],
            speeds.right + speeds.right_sd * errors[1],
        )
        rightward = downwind[::-1] * (1, -1)
        positions += 360 * (along[:, None] * downwind + across[:, None] * rightward)
        on_left ^= rng.random(count) < -math.expm1(-0.1 * rate)
    return positions


def veering(hours: float) -> tuple[float, float]:
    """A wind that grows and turns by some 120 degrees in twelve hours."""
    return 9 - hours, -3 - 0.8 * hours


@pytest.mark.thorough
@pytest.mark.parametrize("rate", [0, 0.04])
@pytest.mark.parametrize(
    ("name", "hours", "wind_at"),
    [
        ("SKIFF-4", 2, lambda hours: (5.0, -9.0)),
        ("PIW-4", 12, veering),
        ("SKIFF-1", 9, veering),
        ("SPORT-BOAT", 60, lambda hours: (5.0, -9.0)),
    ],
)
def test_a_person_drifts_and_jibes_like_the_full_model(name, hours, wind_at, rate):
    """When the search begins, mean and variances are those of simulated objects."""
    winds = {3600 * hour: wind_at(hour) for hour in (0, 12)}  # linear in between
    changes = {"wind": winds, "adrift": 3600 * hours, "diffusivity": 0.0, "jibing": rate}
    objects = drifted(leeway.CLASSES[name], wind_at, hours, rate, 20_000)
    truth = 30 + objects * (1, -1) / SCALE.metres_per_cell
    size = truth.std(axis=0).max()
    person = leeway.person(name, **{**USUAL, **changes})
    forecasts = [moved(drift) for drift in person.drift.drifts]
    weights, means, spreads = person.drift.weights, *map(np.array, zip(*forecasts, strict=True))
    mean = np.array(weights) @ means
    variance = np.array(weights) @ (spreads**2 + (means - mean) ** 2)
    np.testing.assert_allclose(mean, truth.mean(axis=0), atol=0.03 * size)
    np.testing.assert_allclose(variance, truth.var(axis=0), atol=0.05 * size**2)


def moved(drift: Drift) -> tuple[np.ndarray, np.ndarray]:
    """The mean position and its standard deviation when the search begins, without diffusion."""
    sums = []
    for each in (drift.vector, drift.vector_sd):
        rows = np.atleast_2d(each)
        sums.append(rows[np.minimum(np.arange(drift.adrift), len(rows) - 1)].sum(axis=0))
    return drift.start + sums[0], np.hypot(drift.start_sd, sums[1])


def test_objects_that_have_jibed_are_hypotheses_of_their_own():
    """They are now on one side of the wind, and were on the other one for half of the time."""
    usual = {**USUAL, "wind": (0, 10), "adrift": 4 * 3600, "position_sd": 260}
    right, left, was_left, was_right = leeway.person("SKIFF-1", **usual).drift.drifts
    assert was_left.vector == right.vector and was_right.vector == left.vector
    jibed = 1 - math.exp(-0.16)
    assert was_left.weight == was_right.weight == pytest.approx(jibed / 2, rel=1e-3)
    assert right.weight == left.weight == pytest.approx((1 - jibed) / 2, rel=1e-3)
    across = right.adrift * (right.vector[0] - left.vector[0])
    assert was_left.start == pytest.approx((30 - across / 2, 30), abs=0.03 * across)
    assert was_left.start_sd == pytest.approx((math.hypot(2, across / math.sqrt(12)), 2), rel=0.02)


@pytest.mark.parametrize(
    "changes", [{"jibing": 0}, {"adrift": 0}, {"adrift": 600}, {"wind": (0, 0)}]
)
def test_without_jibes_there_are_only_the_sides(changes):
    usual = {**USUAL, "adrift": 7200}
    assert len(leeway.person("PIW-1", **usual).drift.drifts) == 4
    assert len(leeway.person("PIW-1", **{**usual, **changes}).drift.drifts) == (
        1 if "wind" in changes else 2
    )


def test_a_series_is_linear_between_its_times():
    """Each step has the value in its middle; it is constant before the first and after the last."""
    scale = Scale(100, 10)
    calm = {"start": (30, 30), "wind": (0, 0)}
    currents = {20: (1, 0), 40: (3, -2)}
    (drift,) = leeway.person("PIW-1", **calm, current=currents, scale=scale).drift.drifts
    rows = [(0.1, 0), (0.1, 0), (0.15, 0.05), (0.25, 0.15), (0.3, 0.2)]
    np.testing.assert_allclose(drift.vector, rows, atol=1e-15)
    constant = leeway.person("PIW-1", **USUAL, current=(0.1, 0.2), adrift=3600)
    one_time = {"wind": {900: USUAL["wind"]}, "current": {7200: (0.1, 0.2)}}
    assert leeway.person("PIW-1", **{**USUAL, **one_time}, adrift=3600) == constant
    tide = leeway.person("PIW-1", **USUAL, current=currents, adrift=3600)
    assert [each.vector_sd for each in tide.drift.drifts] == [
        each.vector_sd for each in constant.drift.drifts
    ]


def test_directions_as_they_are_reported():
    """Winds come from a direction, currents go to one; degrees run clockwise from north."""
    assert geo.wind_from(0, 10) == pytest.approx((0, -10))
    assert geo.wind_from(270, 10) == pytest.approx((10, 0))
    assert geo.current_towards(90, 2) == pytest.approx((2, 0))
    assert geo.current_towards(-135, 2 * geo.KNOT) == pytest.approx((-0.7275, -0.7275), abs=1e-4)
    assert pytest.approx(1.852) == geo.KNOT * 3.6


def test_a_forecast_beyond_the_grid_is_warned_of():
    leeway.person("PIW-1", **USUAL)
    leeway.person("PIW-1", **USUAL, grid_size=61, timestep_limit=277)
    with pytest.warns(
        UserWarning, match=r"\d% of a person's forecast .* 40 x 40 cells at step 277"
    ):
        person = leeway.person("PIW-1", **USUAL, grid_size=40, timestep_limit=277)
    assert person.drift.mass_beyond(40, 277) > 0.01
    inwards = {"start": (-2, 30), "wind": (10, 0), "scale": SCALE, "position_sd": 130}
    with pytest.warns(UserWarning, match="at step 0"):
        leeway.person("LIFE-RAFT-NB-4", **inwards, grid_size=61, timestep_limit=100)


def test_a_drift_of_more_than_a_cell_per_step_is_warned_of():
    with pytest.warns(UserWarning, match=r"mean drift is 1\.5 cells per step"):
        leeway.person("PIW-1", start=(3, 3), wind=(0, 0), current=(15, 0), scale=SCALE)


def test_too_much_diffusion_for_a_step_is_refused():
    with pytest.raises(ValueError, match=r"must be at most 0\.333 m²/s .*got 5\.0: take shorter"):
        leeway.person("PIW-1", start=(3, 3), wind=(5, 0), diffusivity=5.0, scale=Scale(10, 100))
    leeway.person("PIW-1", start=(3, 3), wind=(5, 0), diffusivity=0.333, scale=Scale(10, 100))


@pytest.mark.parametrize(
    ("name", "nearest"), [("kayak", "PERSON-POWERED-VESSEL-1"), ("quux", "the keys are PIW-1")]
)
def test_an_unknown_class_names_the_nearest_ones(name, nearest):
    with pytest.raises(ValueError, match=rf"object_class must .*got '{name}'; .*{nearest}"):
        leeway.person(name, **USUAL)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"object_class": 1}, TypeError, "object_class must be a key"),
        ({"start": (30.5, 30)}, ValueError, r"start\[0\] must be a whole number"),
        ({"position_sd": -1}, ValueError, "position_sd must .*at least 0, got -1"),
        ({"wind": 10}, TypeError, "wind must be two finite numbers"),
        ({"wind": (2000, 0)}, ValueError, "the speed of wind must .*at most 1000.0, got 2000"),
        ({"scale": (130, 13)}, TypeError, r"scale must be a Scale, got \(130, 13\)"),
        ({"wind": {datetime(2026, 1, 1): (5, 0)}}, TypeError, "time of wind, in seconds .* got da"),
        ({"wind": {1.7e9: (5, 0)}}, ValueError, "time of wind, in seconds from .* got 1700000000"),
        ({"current": {0: 5}}, TypeError, "current must be two finite numbers"),
        ({"current": {}}, TypeError, "current must be two finite numbers .*got {}"),
        ({"jibing": 4}, ValueError, "jibing must .*at most 1, got 4"),
        ({"grid_size": 61}, ValueError, "grid_size and timestep_limit must be given together"),
        ({"grid_size": 20, "timestep_limit": 9}, ValueError, r"start\[0\] must .*from 0 to 19"),
    ],
)
def test_bad_persons_are_rejected(changes, error, message):
    with pytest.raises(error, match=message):
        leeway.person(**{"object_class": "PIW-1", **USUAL, **changes})


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: geo.wind_from("SW", 10), TypeError, "direction must .*got 'SW'"),
        (lambda: geo.current_towards(90, -1), ValueError, "speed must .*at least 0, got -1"),
        (lambda: leeway.CLASSES["PIW-1"].speeds(-1), ValueError, "wind_speed must .*got -1"),
        (lambda: leeway.ObjectClass("A", "", (1, 2), (), ()), ValueError, "downwind must be three"),
    ],
)
def test_bad_values_are_rejected(call, error, message):
    with pytest.raises(error, match=message):
        call()
