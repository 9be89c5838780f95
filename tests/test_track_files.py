"""`Tracks.read`: files of OpenDrift, other CF trajectory files, and files of another kind."""

import json
import re
import sys
import tempfile
import time
import warnings
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from netcdf_tracks import HOURS, NOON, nc, write

from DroneSwarmSearch import Person, Scale, Scenario, Tracks

SCALE = Scale(200, 60)
ORIGIN = (4.8, 60.0)


def track(*longitudes: float) -> list[tuple[float, float]]:
    """One position an hour, at 60 degrees north; the person drifts east by some 560 m an hour."""
    return [(longitude, 60.0) for longitude in longitudes]


DRIFTING = track(4.80, 4.81, 4.82, 4.83)
NOWHERE = (np.nan, np.nan)


def read(path: Path, **options: Any) -> Tracks:
    return Tracks.read(path, **{"scale": SCALE, "origin": ORIGIN[::-1], **options})


@pytest.mark.thorough
@given(
    times=st.lists(st.integers(0, 7200), min_size=2, max_size=9, unique=True).map(sorted),
    start=st.floats(0, 1),
    seconds=st.integers(10, 2000),
)
def test_positions_are_interpolated(times, start, seconds):
    begin = int(times[0] + start * (times[-1] - times[0]))
    expected_steps = (times[-1] - begin) // seconds
    assume(expected_steps > 0)
    degrees = np.random.default_rng(0).uniform(-0.01, 0.01, (3, len(times), 2)) + ORIGIN
    with tempfile.TemporaryDirectory() as folder:
        path = write(Path(folder) / "a.nc", degrees, times, dtype="f8")
        scale = Scale(2000, seconds)
        tracks = read(path, scale=scale, start=NOON + timedelta(seconds=begin))
    assert tracks.steps == expected_steps
    at = begin + seconds * np.arange(tracks.steps + 1)
    for element in range(3):
        x = np.interp(at, times, degrees[element, :, 0] - ORIGIN[0]) * 27.9
        y = np.interp(at, times, ORIGIN[1] - degrees[element, :, 1]) * 55.7
        found = tracks.positions[:, element]
        np.testing.assert_allclose(found, np.stack([x, y], axis=1), atol=0.001)


@pytest.mark.parametrize(
    ("start", "steps", "first"),
    [
        (None, None, 0),
        (NOON + timedelta(minutes=30), 90, 0.5),
        (NOON.astimezone(timezone(timedelta(hours=-5))) + timedelta(hours=1), None, 1),
        (NOON + timedelta(hours=3, minutes=-1), 1, 2 + 59 / 60),
    ],
)
def test_start_and_steps(tmp_path, start, steps, first):
    tracks = read(write(tmp_path / "a.nc", [DRIFTING]), start=start, steps=steps)
    assert tracks.steps == (steps or round((3 - first) * 60))
    whole = read(tmp_path / "a.nc").positions[round(first * 60) :]
    np.testing.assert_allclose(tracks.positions, whole[: tracks.steps + 1], atol=1e-9)


@pytest.mark.skipif(not hasattr(time, "tzset"), reason="Windows has no tzset")
def test_times_are_utc_on_any_machine(tmp_path, monkeypatch):
    path = write(tmp_path / "a.nc", [DRIFTING])
    expected = read(path, start=NOON + timedelta(hours=1))
    with monkeypatch.context() as patch:
        patch.setenv("TZ", "America/New_York")
        time.tzset()
        tracks = read(path, start=NOON + timedelta(hours=1))
    time.tzset()
    assert tracks == expected


@pytest.mark.parametrize(
    "layout",
    [
        {"order": ("time", "trajectory")},
        {"names": ("x", "y", "t")},
        {"standard_names": False},
        {"names": ("longitude", "latitude", "time"), "standard_names": False},
        {"dtype": "i4"},
        {"dtype": "f8", "names": ("longitude", "latitude", "time")},
        {"seconds": HOURS / 86400, "units": "days since 2026-06-01 12:00:00"},
        {"seconds": 14 + HOURS / 3600, "units": "hours since 2026-06-01 00:00:00 +02:00"},
        {"calendar": "proleptic_gregorian"},
        {"calendar": None},
    ],
    ids=str,
)
def test_other_files_of_the_convention(tmp_path, layout):
    stranding = [*DRIFTING[:2], NOWHERE, NOWHERE]
    expected = read(write(tmp_path / "a.nc", [DRIFTING, stranding], status=[[0] * 4, [0, 1, 0, 0]]))
    path = write(
        tmp_path / "b.nc", [DRIFTING, stranding], **layout, status=[[0] * 4, [0, 1, -1, -1]]
    )
    tracks = read(path)
    assert (tracks.stranded, tracks.lost) == (1, 0)
    np.testing.assert_allclose(tracks.positions, expected.positions, atol=0.01)
    later = read(path, start=NOON + timedelta(hours=1))
    np.testing.assert_allclose(later.positions, expected.positions[60:], atol=0.01)


MANY = [DRIFTING] * 19


@pytest.mark.parametrize(
    ("last", "status", "window", "stranded", "lost"),
    [
        ([*DRIFTING[:2], NOWHERE, NOWHERE], [0, 1, -1, -1], (0, 3), 1, 0),
        ([*DRIFTING[:2], NOWHERE, NOWHERE], [0, 1, -1, -1], (2, 3), 1, 0),  # before the search
        ([*DRIFTING[:2], NOWHERE, NOWHERE], [0, 2, -1, -1], (0, 3), 0, 1),
        ([*DRIFTING[:2], NOWHERE, NOWHERE], [0, 2, -1, -1], (0, 1), 0, 0),  # after the search
        ([*DRIFTING[:2], NOWHERE, NOWHERE], [0, 0, -1, -1], (0, 3), 0, 1),
        ([*DRIFTING[:2], NOWHERE, NOWHERE], [0, 2, -1, -1], (2, 3), 0, 1),
        ([*DRIFTING[:3], DRIFTING[2]], [0, 0, 1, 1], (0, 3), 1, 0),
        ([*DRIFTING[:3], DRIFTING[2]], [0, 0, 1, 1], (0, 1), 0, 0),
        ([NOWHERE, *DRIFTING[:3]], [-1, 0, 0, 0], (0, 3), 0, 1),
        ([NOWHERE, *DRIFTING[:3]], [-1, 0, 0, 0], (1, 3), 0, 0),
        ([NOWHERE] * 4, [-1] * 4, (0, 3), 0, 1),
    ],
)
def test_elements_strand_and_are_lost(tmp_path, last, status, window, stranded, lost):
    path = write(tmp_path / "a.nc", [*MANY, last], status=[[0] * 4] * 19 + [status])
    begin, end = window
    tracks = read(path, start=NOON + timedelta(hours=begin), steps=60 * (end - begin))
    assert (len(tracks), tracks.stranded, tracks.lost) == (20 - lost, stranded, lost)
    assert (f"{lost} lost and left out" in repr(tracks)) == (lost > 0)
    assert (f"{stranded} stranded" in repr(tracks)) == (stranded > 0)
    if stranded:
        assert not np.ptp(tracks.positions[60 * (2 - begin) :, -1], axis=0).any()


@pytest.mark.parametrize("flags", [{}, {"flag_values": np.int32(0), "flag_meanings": "active"}])
def test_without_a_flag_for_stranding_what_ends_is_lost(tmp_path, flags):
    ending = [*DRIFTING[:2], NOWHERE, NOWHERE]
    status = [[0] * 4] * 19 + [[0, 1, -1, -1]]
    tracks = read(write(tmp_path / "a.nc", [*MANY, ending], status=status, flags=flags))
    assert (tracks.stranded, tracks.lost) == (0, 1)
    tracks = read(write(tmp_path / "b.nc", [*MANY, ending]))
    assert (tracks.stranded, tracks.lost) == (0, 1)


def test_diffusivity_is_a_random_walk_until_an_element_strands(tmp_path):
    still = track(4.8, 4.8, 4.8, 4.8)
    ashore = [*still[:2], NOWHERE, NOWHERE]
    status = [[0] * 4] * 1000 + [[0, 1, -1, -1]] * 1000
    path = write(tmp_path / "a.nc", [still] * 1000 + [ashore] * 1000, status=status)
    tracks = read(path, diffusivity=2.0, seed=3)
    for elements, seconds in (((0, 1000), (3600, 10_800)), ((1000, 2000), (3600, 3600))):
        own = tracks.positions[:, slice(*elements)] * SCALE.metres_per_cell
        for step, adrift in zip((60, 180), seconds, strict=True):
            # The standard error of a variance of 1,000 draws is 4.5 %.
            np.testing.assert_allclose(own[step].var(axis=0), 2 * 2.0 * adrift, rtol=0.2)
    assert not np.ptp(tracks.positions[60:, 1000:], axis=0).any()
    assert tracks == read(path, diffusivity=2.0, seed=3)
    assert tracks != read(path, diffusivity=2.0, seed=4)
    assert read(path).positions.std() < 1e-3


RELEASED = [[NOWHERE] * hours + [*DRIFTING[hours:]] for hours in (0, 1, 1, 2)]


def test_elements_released_over_some_hours(tmp_path):
    """By default, the search begins when all elements are adrift; the message names that time."""
    path = write(tmp_path / "a.nc", RELEASED)
    tracks = read(path)
    assert (tracks.steps, len(tracks), tracks.lost) == (60, 4, 0)
    assert tracks == read(path, start=NOON + timedelta(hours=2))
    assert "from 2026-06-01T14:00:00+00:00" in repr(tracks)
    assert Tracks.from_dict(tracks.to_dict()) == tracks
    assert "from 2026-06-01T13:00" in repr(read(write(tmp_path / "b.nc", RELEASED[:3])))
    with pytest.raises(ValueError, match=r"start at 2026-06-01 14:00:00\+00:00, when all are adr"):
        read(path, start=NOON)
    with pytest.raises(ValueError, match=r"adrift from 2026-06-01 14:00:00\+00:00\), got start=N"):
        read(path, steps=120)


def test_times_less_precise_than_a_step(tmp_path):
    """As float32, seconds since 1970 are multiples of 128 s."""
    path = write(tmp_path / "a.nc", [DRIFTING])
    seconds = NOON.timestamp() + HOURS
    for dtype, step, warns in (("f4", 60, True), ("f4", 600, False), ("f8", 60, False)):
        with nc.Dataset(path, "w") as data:
            data.createDimension("trajectory", 1)
            data.createDimension("time", 4)
            data.createVariable("time", dtype, ("time",))[:] = seconds
            data["time"].units = "seconds since 1970-01-01"
            for name, degrees in zip(("lon", "lat"), np.array(DRIFTING).T, strict=True):
                data.createVariable(name, "f8", ("trajectory", "time"))[:] = degrees[None]
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            read(path, scale=Scale(200, step))
        texts = [str(each.message) for each in caught]
        assert [
            f"keeps times as float32, to 128 s only, and a step takes {step} s" in each
            for each in texts
        ] == [True] * warns


def test_latitude_and_longitude_exchanged(tmp_path):
    path = write(tmp_path / "a.nc", np.array([DRIFTING])[..., ::-1])
    with pytest.warns(UserWarning, match="no track of .* comes within .* exchanged, here or in"):
        read(path)
    far = write(tmp_path / "b.nc", [track(4.8, 4.81)] + [track(9.0, 9.01)] * 20, HOURS[:2])
    read(far)  # one comes near


NAIVE = datetime(2026, 6, 1, 12)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"scale": None}, TypeError, "scale must be a Scale, got None"),
        ({"scale": (200, 60)}, TypeError, "scale must be a Scale, got (200, 60)"),
        ({"origin": None}, TypeError, "origin must be (latitude, longitude) in degrees, got None"),
        ({"origin": (1, 2, 3)}, ValueError, "origin must be (latitude, longitude) in degrees, got"),
        ({"origin": (4.8, "60 N")}, TypeError, "origin[1] must be a finite number, got '60 N'"),
        ({"cell": 3}, TypeError, "cell must be two finite numbers (x, y), got 3"),
        ({"start": NAIVE}, ValueError, "start must be a datetime with a time zone, got datetime"),
        ({"start": "12:00"}, TypeError, "start must be a datetime with a time zone, got '12:00'"),
        ({"start": NOON - timedelta(seconds=1)}, ValueError, "start=2026-06-01T11:59:59+00:00"),
        ({"start": NOON + timedelta(hours=3)}, ValueError, "12:00:00+00:00 to 2026-06-01 15:00:00"),
        ({"start": NOON + timedelta(days=9)}, ValueError, "start and steps must lie within the"),
        ({"steps": 181}, ValueError, "steps=181 of 60 s"),
        ({"steps": 2.5}, TypeError, "steps must be an integer of at least 1, got 2.5"),
        ({"steps": 0}, ValueError, "steps must be an integer of at least 1, got 0"),
        ({"scale": Scale(200, 20_000)}, ValueError, "steps=None of 20000 s"),
        ({"scale": Scale(2, 60)}, ValueError, "take shorter steps or larger cells"),
        ({"diffusivity": -1}, ValueError, "diffusivity must be a finite number of at least 0"),
        ({"seed": 1.5}, TypeError, "seed must be an integer of at least 0, got 1.5"),
    ],
    ids=str,
)
def test_bad_arguments(tmp_path, options, error, message):
    path = write(tmp_path / "a.nc", [DRIFTING])
    with pytest.raises(error, match=re.escape(message)) as raised:
        read(path, **options)
    assert "\n" not in str(raised.value)


def damaged(path: Path) -> None:
    """A NetCDF file with a sound header."""
    without("lon")(path)
    with nc.Dataset(path, "a") as data:
        data.createDimension("many", 50_000)
        variable = data.createVariable("lon", "f8", ("many", "time"), zlib=True)
        variable.standard_name = "longitude"
        variable[:] = np.random.default_rng(0).random((50_000, 3))
    content = path.read_bytes()
    middle = len(content) // 2
    path.write_bytes(content[:middle] + bytes(1000) + content[middle + 1000 :])


def without(*names: str) -> Any:
    def make(path: Path) -> None:
        with nc.Dataset(path, "w") as data:
            data.createDimension("time", 3)
            data.createDimension("obs", 3)
            for name in sorted({"lon", "lat", "time"} - {*names}):
                variable = data.createVariable(name, "f8", ("time",))
                if name == "time":
                    variable.units = "seconds since 1970-01-01"
                variable.standard_name = {"lon": "longitude", "lat": "latitude"}.get(name, name)
                variable[:] = np.arange(3.0)

    return make


def ragged(path: Path) -> None:
    """Two elements of two and three observations, as a contiguous ragged array of CF."""
    with nc.Dataset(path, "w") as data:
        data.createDimension("trajectory", 2)
        data.createDimension("obs", 5)
        data.createVariable("trajectory", "i4", ("trajectory",))[:] = [1, 2]
        counts = data.createVariable("rowSize", "i4", ("trajectory",))
        counts.sample_dimension = "obs"
        counts[:] = [2, 3]
        for name, values in (("time", [0, 1, 0, 1, 2]), ("lon", range(5)), ("lat", range(5))):
            data.createVariable(name, "f8", ("obs",))[:] = values
        data["time"].units = "hours since 2026-06-01"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda path: path.write_text("time,lon,lat\n"), "must be a NetCDF file, got another"),
        (lambda path: path.write_bytes(b""), "must be a NetCDF file, got another"),
        (
            lambda path: path.write_bytes(write(path, MANY).read_bytes()[:-500]),
            "must be a NetCDF file, got another",
        ),
        (lambda path: nc.Dataset(path, "w").close(), "longitude, latitude and time, .*none"),
        (without("lon"), "standard names longitude, latitude and time, .*got lat.time., time"),
        (without("time"), "the standard names longitude, latitude and time"),
        (damaged, r"longitude, latitude and time, .* got .*lon\(many, time\)"),
        (without(), "for many elements at common times"),  # one trajectory, without a dimension
        (
            lambda path: write(path, MANY, units=None),
            "common times .* got .*time.*, times in no units$",
        ),
        (
            lambda path: write(path, MANY, units="s"),
            "common times of the usual calendar .*, times in s$",
        ),
        (lambda path: write(path, MANY, calendar="360_day"), "the usual calendar .*, times in sec"),
        (
            lambda path: write(path, MANY, HOURS[::-1]),
            "must have times that increase, .*, got 2026-06-01 14:00:00.00:00 after 2026-06-01 "
            "15:00:00.00:00: a simulation backward in time$",
        ),
        (
            lambda path: write(path, MANY, HOURS[[0, 1, 1, 3]]),
            "got .* 13:00.* after .* 13:00[^a-z]*$",
        ),
        (
            lambda path: write(path, MANY, HOURS[[0, 2, 1, 3]]),
            "got .* 13:00.* after .* 14:00[^a-z]*$",
        ),
        (ragged, r"ragged arrays, with .* got .*lon\(obs\), lat\(obs\).*, times in h"),
        (
            lambda path: write(path, [[*DRIFTING[:3], NOWHERE]] * 3 + MANY),
            "must lose at most 10% of its elements before the last step but for stranding, "
            "got 3 of 22: simulate a larger area, start later or take fewer steps",
        ),
        (
            lambda path: write(path, [[DRIFTING[0], NOWHERE, *DRIFTING[2:]]]),
            r"must hold tracks without gaps, got \(nan, nan\) in element 0 at 2026-06-01 13:00",
        ),
    ],
)
def test_bad_files(tmp_path, make, message):
    make(path := tmp_path / "a.nc")
    with pytest.raises(ValueError, match=message) as raised:
        read(path)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("content", [b"", b"not an archive", "others", "half", "array"])
def test_another_npz(tmp_path, content):
    path = tmp_path / "a.npz"
    if content == "array":
        with path.open("wb") as file:
            np.save(file, np.zeros(3))
    elif isinstance(content, str):
        np.savez(path, start=np.zeros(3), others=np.zeros(300))
        path.write_bytes(path.read_bytes()[: 500 if content == "half" else None])
    else:
        path.write_bytes(content)
    with pytest.raises(ValueError, match=r"a\.npz must be a file of Tracks\.save, got another$"):
        Tracks.read(path)


@pytest.mark.parametrize("name", ["none.nc", "none.npz", "."])
def test_missing_file(tmp_path, name):
    with pytest.raises(FileNotFoundError, match="path must name a file, but there is no"):
        read(tmp_path / name)


@pytest.mark.filterwarnings("ignore:.* tracks are few")
@pytest.mark.parametrize("suffix", [".nc", ".npz"])
def test_json_names_the_file(tmp_path, suffix):
    path = write(tmp_path / "a.nc", MANY)
    options = {"start": NOON + timedelta(hours=1), "cell": (5, 5), "diffusivity": 0.1, "seed": 4}
    tracks = read(path, **options)
    if suffix == ".npz":
        tracks.save(path := tmp_path / "a.npz")
        tracks = Tracks.read(path)
    scenario = Scenario(20, persons=Person(tracks, 0.8, fine=1), timestep_limit=20)
    text = json.dumps(scenario.to_dict())
    restored = Scenario.from_dict(json.loads(text))
    assert restored.persons[0].drift.tracks == tracks
    assert restored == scenario
    assert json.dumps(restored.to_dict()) == text

    moved = path.rename(tmp_path / f"b{suffix}")
    with pytest.raises(FileNotFoundError, match=r"there is no .*a\."):
        Scenario.from_dict(json.loads(text))
    moved.rename(path)
    path.write_bytes(path.read_bytes() + b"\0")
    with pytest.raises(ValueError, match=r"a\.\w+ must be as it was when its SHA-256 was saved"):
        Scenario.from_dict(json.loads(text))


@pytest.mark.filterwarnings("ignore:.* tracks are few")
def test_json_of_arrays_holds_no_tracks(tmp_path):
    fitted, _ = read(write(tmp_path / "a.nc", MANY)).split()
    data = Scenario(20, persons=Person(fitted)).to_dict()
    with pytest.raises(ValueError, match="tracks must come from a file to be restored"):
        Scenario.from_dict(json.loads(json.dumps(data)))


def test_without_netcdf4(tmp_path, monkeypatch):
    path = write(tmp_path / "a.nc", MANY)
    monkeypatch.setitem(sys.modules, "netCDF4", None)
    with pytest.raises(ImportError, match=r'pip install "DroneSwarmSearchEnvironment\[tracks\]"'):
        read(path)
