"""The comparison with OpenDrift: its tracks, and a short run as users run it."""

import argparse
import re
from datetime import datetime, timedelta

import numpy as np
import pytest
from trainer_examples import module, run

from DroneSwarmSearch import Scale, leeway

pytest.importorskip("opendrift")

# OpenDrift reads the coastline, too.
pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("real_coast")]

EXAMPLE = "compare_with_opendrift"


@pytest.fixture(scope="module")
def example():
    return module(EXAMPLE)


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("wind", [(0.0, 10.0), (-6.0, 4.0), (5.0, 5.0)])
def test_tracks_drift_as_the_coefficients_state(example, wind):
    """PIW-4 drifts further to the right than to the left of the wind."""
    options = argparse.Namespace(tracks=20_000, jibing=0.0)
    incident = example.Incident("PIW-4", wind, current=(0.2, -0.1), position_sd=0.0)
    np.random.seed(0)
    tracks = incident.tracks(2, options)
    assert tracks.shape == (13, 20_000, 2)
    assert not tracks[0].any()

    velocity = tracks[-1] / 7200 - incident.current
    downwind = np.array(wind) / np.hypot(*wind)
    along = velocity @ downwind
    right = velocity @ (downwind[1], -downwind[0])
    speeds = leeway.CLASSES["PIW-4"].speeds(float(np.hypot(*wind)))
    assert along.mean() == pytest.approx(speeds.downwind, abs=0.002)
    assert along.std() == pytest.approx(speeds.downwind_sd, abs=0.002)
    assert right.mean() == pytest.approx((speeds.right + speeds.left) / 2, abs=0.002)
    assert speeds.right + speeds.left > 0.02


@pytest.mark.parametrize(
    ("options", "searches"),
    [(["--fast", "--jibing", 0], 1), (["--random", 3], 3)],
    ids=["fast", "random"],
)
def test_map_and_plan_agree_with_opendrift(options, searches):
    """The maps without jibing, because they leave it out while nobody searches."""
    printed = run(EXAMPLE, *options, "--tracks", 20_000)
    row = r"^ *(\S+)  (\(.*\)) +{}$"
    maps = re.findall(row.format(r"(\d) h +(\S+) +(\S+) +(\d+) m  (\S+)% (\S+)%"), printed, re.M)
    assert len(maps) == (2 * 2 * 3 if "--fast" in options else 0)
    for name, _, hours, distance, floor, apart, *wider in maps:
        assert float(distance) < 1.2 * float(floor), name
        assert float(apart) < 30 * int(hours), name
        assert all(abs(float(percent)) < 5 for percent in wider), name
    plans = re.findall(row.format(r"(\S+)%  (\S+)%"), printed, re.M)
    assert len(plans) == searches
    for *_, forecast, found in plans:
        assert 40 < float(found) <= float(forecast) + 3
        assert float(forecast) < float(found) + 5


def test_a_plan_for_tracks_finds_what_it_promises_in_an_eddy_off_a_coast():
    printed = run(EXAMPLE, "--coast", "--fast", "--tracks", 5000)
    assert re.search(
        r"<Tracks: 5,000 tracks, 432 steps, [1-9]\d\d stranded, from 2026-\S+, x", printed
    )
    plans = re.findall(r"^ *(\S+)  greedy-posterior +(\S+)%  (\S+)%$", printed, re.M)
    (constant, *promised), (tracks, forecast, found) = plans
    assert (constant, tracks) == ("leeway.person", "Person(tracks)")
    assert float(promised[0]) - float(promised[1]) > 15
    assert 80 < float(found) < float(forecast) < float(found) + 6


@pytest.mark.parametrize("options", [[], ["--coast", "--manual"], ["--hypotheses"]], ids=" ".join)
def test_flights_find_about_what_their_plans_state(options):
    printed = run("fly_plans_over_opendrift", "--incidents", 1, "--tracks", 2000, *options)
    stated, found = re.findall(r"([\d.]+)%", printed.splitlines()[1])[:2]
    assert float(found) == pytest.approx(float(stated), abs=6.0)


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("name", ["PIW-1", "SKIFF-1"])
def test_a_person_in_a_tide_and_a_wind_that_turns_drifts_like_opendrift(name):
    from opendrift.models.leeway import Leeway
    from opendrift.readers import reader_timeseries

    hours = range(13)
    start = datetime(2026, 1, 1)
    winds = {3600 * hour: (9 - 1.2 * hour, -3 - 0.5 * hour) for hour in hours}
    phases = 2 * np.pi * np.array(hours) / 12.4
    tide = {3600 * h: (0.5 * np.cos(phases[h]), 0.1 * np.sin(phases[h])) for h in hours}
    sea = dict(zip(("x_wind", "y_wind"), np.transpose(list(winds.values())), strict=True))
    currents = np.transpose(list(tide.values()))
    sea |= zip(("x_sea_water_velocity", "y_sea_water_velocity"), currents, strict=True)
    times = {"time": [start + timedelta(hours=hour) for hour in hours]}
    model = Leeway(loglevel=50)
    model.add_reader(reader_timeseries.Reader({**times, **sea, "land_binary_mask": np.zeros(13)}))
    numbers = {row["OBJKEY"]: number for number, row in model.leewayprop.items()}
    place = {"lon": 0.0, "lat": 0.0, "radius": 250.0, "time": start, "number": 20_000}
    np.random.seed(0)
    model.seed_elements(**place, object_type=numbers[name], jibe_probability=0.04)
    steps = {"time_step": 600, "time_step_output": 3600, "export_variables": ["lon", "lat"]}
    model.run(duration=timedelta(hours=12), **steps)
    degrees = np.stack([model.result.lon.values.T, model.result.lat.values.T], axis=-1)
    scale = Scale(130, 13)
    known = {"start": (0.0, 0.0), "position_sd": 250, "diffusivity": 0}
    for hour in (3, 6, 9, 12):
        sea_at = {"wind": winds, "current": tide, "adrift": 3600 * hour, "scale": scale}
        person = leeway.person(name, **known, **sea_at)
        means = []
        squares = []
        for drift in person.drift.drifts:
            sums = []
            for series in (drift.vector, drift.vector_sd):
                rows = np.atleast_2d(series)
                sums.append(rows[np.minimum(np.arange(drift.adrift), len(rows) - 1)].sum(axis=0))
            means.append(drift.start + sums[0])
            squares.append(np.square(drift.start_sd) + sums[1] ** 2)
        mean = np.average(means, axis=0, weights=person.drift.weights)
        variances = np.array(squares) + np.square(means - mean)
        deviation = np.sqrt(np.average(variances, axis=0, weights=person.drift.weights))
        cells = degrees[hour] * (111_319.5, -110_574.4) / scale.metres_per_cell
        np.testing.assert_allclose(mean, cells.mean(axis=0), atol=0.03 * deviation.max())
        np.testing.assert_allclose(deviation, cells.std(axis=0), rtol=0.02)
