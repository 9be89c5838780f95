"""The command `plan`: what it refuses, what it prints, and the folder that it writes."""

import csv
import errno
import json
import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from DroneSwarmSearch import cli
from DroneSwarmSearch._internal.progress import progress
from DroneSwarmSearch.commands import plan as command
from DroneSwarmSearch.incident import FlightPlan, Incident, simulate, write
from DroneSwarmSearch.incident import plan as plan_flights
from DroneSwarmSearch.incident.files import chart

pytest.importorskip("cmaes")
nc = pytest.importorskip("netCDF4")

KNOWN: dict[str, Any] = {
    "position": (54.2, 7.8),
    "time": "2026-03-01T05:30Z",
    "object_class": "PIW-1",
    "wind": "300 10kn",
    "endurance": "20min",
}
OPTIONS = "--time 2026-03-01T05:30Z --object PIW-1 --endurance 20min"
PLACE = "--position 54.2 7.8"
HERE = f"{OPTIONS} {PLACE} --wind 300 10kn"


@pytest.fixture(scope="module")
def plan():
    return plan_flights(Incident(**KNOWN, drones=3))


@pytest.fixture(scope="module")
def small(plan):
    """A plan of fewer drones, elsewhere."""
    return plan_flights(Incident(**{**KNOWN, "position": (-17.0, 180.0)}, drones=1, night=True))


def refused(capsys: Any, options: str, *more: str) -> str:
    """The error of the command with these options."""
    with pytest.raises(SystemExit, match="2"):
        cli.main(["plan", *options.split(), *more])
    return capsys.readouterr().err.splitlines()[-1].partition("error: ")[2]


# Options that are refused, and what the message says.
REFUSED = {
    "position twice": (f"{HERE} --position 54.3 7.9", "--position: must be given once, got 54.2 7"),
    "time twice": (f"{HERE} --time 2026-03-01T06:30Z", "--time: must be given once"),
    "object twice": (f"{HERE} --object PIW-2", "--object must be CLASS:WEIGHT, such as PIW-1:0.3"),
    "base twice": (f"{HERE} --base 54.2 7.8 --base 54.2 7.9", "--base: must be given once"),
    "speed twice": (f"{HERE} --speed 20m/s --speed 30m/s", "--speed: must be given once"),
    "endurance twice": (f"{HERE} --endurance 30min", "--endurance: must be given once, got 20min"),
    "drones twice": (f"{HERE} --drones 2 --drones 3", "--drones: must be given once, got 2 and 3"),
    "swath twice": (
        f"{HERE} --swath 200 m --swath 60 m",
        "--swath must be given once, or as CLASS",
    ),
    "out twice": (f"{HERE} --out a", "--out: must be given once"),
    "an abbreviation": (f"{HERE} --endur 30min", "--endurance: must be given once"),
    "after an incident": ("--after a --incident b", "--after cannot be given together with --inci"),
    "two winds": (f"{HERE} --wind 300 30kn", "--wind must be given once for each time, got '300 3"),
    "two currents": (
        f"{HERE} --current 90 1kn --current 95 1kn",
        "--current must be given once fo",
    ),
    "equal times": (
        f"{HERE} --wind 300 30kn@05:30Z",
        "--wind must be given once for each time, got '300 30kn@05:30Z' after another for 2026-03",
    ),
    "wind and file": (
        f"{HERE} --wind-file a.nc",
        "--wind cannot be given together with --wind-fil",
    ),
    "current and file": (
        f"{HERE} --current 90 1kn --current-file a.nc",
        "--current cannot be given together with --current-file",
    ),
    "no wind": (f"{OPTIONS} {PLACE}", "--wind must be given, such as 300 25kn"),
    "no object": (f"--time 2026-03-01T05:30Z {PLACE}", "--object must be given, such as PIW-1"),
    "no time": (f"--object PIW-1 {PLACE} --wind 300 9kn", "--time must be a time with a zone"),
    "29:75Z": (
        f"{HERE} --wind 300 30kn@29:75Z",
        "--wind must be a time from 00:00Z to 23:59Z, got",
    ),
    "24:00Z": (f"{HERE} --wind 300 30kn@24:00Z", "--wind must be a time from 00:00Z to 23:59Z"),
    "start 06:75Z": (f"{HERE} --start 06:75Z", "--start must be a time from 00:00Z to 23:59Z"),
    "a start before": (f"{HERE} --start 05:00Z", "--start must not be before --time"),
    "a gale": (f"{OPTIONS} {PLACE} --wind 300 60kn", "--speed must exceed the headwind"),
    "a start next week": (f"{HERE} --start 2026-03-08T05:30Z", "--start must be at most 72 hours"),
    "a start next year": (f"{HERE} --start 2027-03-01T05:30Z", "--start must be at most 72 hours"),
    "year 9999": (
        f"{HERE} --start 9999-12-31T23:59Z",
        "--start must be from 1970 to 2100, got 9999",
    ),
    "year 1": (f"{HERE} --start 0001-01-01T00:00Z", "--start must be from 1970 to 2100"),
    "wind in 9999": (
        f"{HERE} --wind 300 9kn@9999-12-31T23:00Z",
        "--wind must be from 1970 to 2100",
    ),
    "wind of yesterday": (
        f"{HERE} --wind 300 9kn@2026-02-28T04:00Z",
        "--wind must be given for times within a day of the incident, which lasts from 2026-03-01",
    ),
    "wind of the day after": (
        f"{HERE} --wind 300 9kn@2026-03-03T04:00Z",
        "--wind must be given for times within a day of the incident",
    ),
    "a wind tonight": (
        f"{HERE} --wind 300 9kn@18:00Z",
        "--wind must have dates where it lasts longer than half a day: 18:00Z would be 2026-02-28",
    ),
    "an endurance of days": (
        f"--time 2026-03-01T05:30Z --object PIW-1 --endurance 100h {PLACE} --wind 300 10kn",
        "--endurance must be above 0 and at most 12 h, got '100h'",
    ),
    "a thin strip": (f"{HERE} --swath 0.000001m", "--swath must be from 1 m to 60 km, got '0.0"),
    "a wide strip": (f"{HERE} --swath 61km", "--swath must be from 1 m to 60 km, got '61km'"),
    "a fast drone": (
        f"{HERE} --speed 1000000m/s",
        "--speed must be above 0 and at most 200 m/s",
    ),
    "a long turn": (f"{HERE} --turn 1h", "--turn must be from 0 to 10 min, got '1h'"),
    "a large error": (f"{HERE} --error 200km", "--error must be from 0 to 100 km, got '200km'"),
    "a certain find": (f"{HERE} --detection 1.1", "--detection must be a finite number"),
    "an HDF file": (
        f"{OPTIONS} {PLACE} --wind era5.h5",
        "--wind must be text such as 300 25kn, or a",
    ),
    "a store": (f"{HERE} --current my/ocean.zarr", "--current must be text such as 300 25kn, or a"),
    "a missing file": (
        f"{OPTIONS} {PLACE} --wind none.NC",
        "--wind must name a file, but there is",
    ),
    "a missing field": (
        f"{OPTIONS} {PLACE} --wind-file none.nc",
        "--wind-file must name a file, but",
    ),
    "no position": (
        f"{OPTIONS} --wind 300 9kn --position 54.2,x,7",
        "--position: a position is such",
    ),
    "a position at the pole": (
        f"{OPTIONS} --wind 300 9kn --position 99,18",
        "--position must be (la",
    ),
}


@pytest.mark.thorough
@pytest.mark.parametrize(("options", "message"), REFUSED.values(), ids=REFUSED)
def test_options_are_refused_by_name(capsys, monkeypatch, tmp_path, options, message):
    monkeypatch.chdir(tmp_path)
    assert message in refused(capsys, options, "--out", "plan")
    assert not Path("plan").exists()


def test_a_repeated_option_of_other_commands(capsys):
    for words in (
        ["evaluate", "random", "pond", "--episodes", "5", "--episodes", "6"],
        ["leaderboard", "--searches", "pond", "--searches", "fog"],
        ["record", "pond", "--out", "a.gif", "--seed", "1", "--seed", "2"],
        ["play", "pond", "--seed", "1", "--seed", "2"],
    ):
        with pytest.raises(SystemExit, match="2"):
            cli.main(words)
        assert "must be given once, got" in capsys.readouterr().err


WINDS = {
    "UTF-16": (
        "time,direction,speed\n05:30Z,300,9kn\n".encode("utf-16"),
        "must be a CSV file in UTF-8",
    ),
    "Latin-1": (
        "time,direction,speed\n05:30Z,300°,9kn\n".encode("latin-1"),
        "must be a CSV file in UTF-8",
    ),
    "semicolons": (b"time;direction;speed\n05:30Z;300;9kn\n", "no column 'direction'"),
    "no rows": (b"time,direction,speed\n", "no rows"),
    "nothing": (b"", "no rows"),
    "zeros": (b"time,direction,speed\n05:30Z,300,\x00\n", "a number and a unit"),
    "a short row": (b"time,direction,speed\n05:30Z,300\n", "a number and a unit"),
    "no times": (b"time,direction,speed\n,300,9kn\n", "must be a time with a zone"),
    "equal times": (b"time,direction,speed\n05:30Z,300,9kn\n0530,310,9kn\n", "once for each time"),
    "two days": (
        b"time,direction,speed\n00:00Z,300,9kn\n12:00Z,300,9kn\n18:00Z,300,9kn\n00:00Z,350,40kn\n",
        "must have dates where it lasts longer than half a day",
    ),
    "weeks before": (
        b"time,direction,speed\n2026-02-05T05:30Z,300,9kn\n2026-02-06T05:30Z,300,30kn\n",
        "within a day of the incident",
    ),
}


@pytest.mark.parametrize(("content", "message"), WINDS.values(), ids=WINDS)
def test_files_of_winds_are_refused_by_name(tmp_path, content, message):
    path = tmp_path / "wind.csv"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=rf"^wind.*{message}"):
        Incident(**{**KNOWN, "wind": str(path)})


def test_suffixes_may_have_capitals(tmp_path):
    path = tmp_path / "WIND.CSV"
    path.write_bytes(b"\xef\xbb\xbftime,direction,speed\r\n05:00Z,0,1m/s\r\n05:45Z,0,2m/s\r\n")
    wind = Incident(**{**KNOWN, "wind": path}).wind
    assert list(wind.vectors_from(0.0)) == [-1800.0, 900.0]


@pytest.mark.parametrize(
    ("clock", "shown"),
    [
        ("05:00Z", "05:00"),
        ("00:10Z", "00:10"),
        ("17:29Z", "17:29"),
        ("17:30Z", "17:30"),
        ("1729", "17:29"),
        ("17:31Z", "2026-02-28 17:31"),
        ("23:30Z", "2026-02-28 23:30"),
    ],
)
def test_a_time_of_the_clock_is_the_nearest(clock, shown):
    """The incident is at 05:30; the sentence says the day where it is another one."""
    sentence = Incident(**{**KNOWN, "wind": [f"300 9kn@{clock}"]}).sentence
    assert f"(4.6 m/s) at {shown};" in sentence


def test_a_start_of_the_clock():
    assert Incident(**KNOWN, start="06:15Z").start.isoformat() == "2026-03-01T06:15:00+00:00"
    late = Incident(**{**KNOWN, "time": "2026-02-28T23:50Z"}, start="00:20Z")
    assert "3 drones from 2026-03-01 00:20." in late.sentence


WRONG = {
    "no wind at all": ({"wind": {}}, ValueError, "wind must hold at least one time, got {}"),
    "a list of nothing": ({"wind": []}, ValueError, "wind must be"),
    "a height": ({"position": (54.18, 7.85, 99)}, ValueError, "position must be (latitude, longi"),
    "one number": ({"position": (54.18,)}, ValueError, "position must be (latitude, longitude)"),
    "a number": ({"position": 54.18}, TypeError, "position must be (latitude, longitude)"),
    "a huge latitude": ({"position": (10**400, 7)}, ValueError, "position[0] must be a finite"),
    "a huge swath": ({"swath": 10**400}, ValueError, "swath must be a finite number"),
    "a huge wind": ({"wind": (10**400, 0)}, ValueError, "wind[0] must be a finite number"),
    "a huge time": ({"wind": {10**400: (1, 1)}}, ValueError, "a time of wind must be a finite"),
    "a far time": ({"wind": {1e300: (1, 1)}}, ValueError, "wind must be given for times within"),
    "a mixed list": ({"wind": ["300 9kn", None]}, TypeError, "wind must be a list of texts"),
    "a start of nothing": ({"start": 6}, TypeError, "start must be a time with a zone"),
    "no time zone": ({"start": "2026-03-01T06:30"}, ValueError, "start must be a time with a zone"),
    "far from there": ({"base": (-54.2, -172.2)}, ValueError, "base must be within 100 km"),
}


@pytest.mark.parametrize(("values", "error", "message"), WRONG.values(), ids=WRONG)
def test_values_are_refused_by_name(values, error, message):
    with pytest.raises(error) as caught:
        Incident(**{**KNOWN, **values})
    assert str(caught.value).startswith(message)


def test_incident_files(tmp_path, capsys):
    path = tmp_path / "incident.json"
    Incident(**KNOWN).write(path)
    text = path.read_text("utf-8")
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert Incident.read(path) == Incident(**KNOWN)
    for content, message in (
        (text.replace('"drones"', '"dronez"'), "got 'dronez'; did you mean drones?"),
        ("[" * 100_000, "JSON must not be nested so deeply"),
        (text[:-9], "must be the file of an incident"),
        (text.replace("300", "300\x00"), "must be the file of an incident"),
    ):
        path.write_text(content, "utf-8")
        assert message in refused(capsys, f"--incident {path} --out {tmp_path / 'plan'}")
    path.write_bytes(text.encode("utf-16"))
    assert "JSON must be in UTF-8" in refused(capsys, f"--incident {path} --out {tmp_path}/plan")


# The position of Cape Town as people type it.
@pytest.mark.parametrize(
    "words", [["-33.9,18.4"], ["-33.9", "18.4"], ["-33.9,", "18.4"], ["33.9S", "18.4E"]]
)
def test_southern_positions_are_no_options(capsys, words):
    options = ["plan", "--position", *words, *OPTIONS.split(), "--wind", "300", "200kn"]
    with pytest.raises(SystemExit):
        cli.main([*options, "--out", "plan"])
    assert "--wind must be at most 60 m/s" in capsys.readouterr().err


def test_values_that_tracks_have_are_refused(tmp_path, capsys):
    path = drifting(tmp_path / "tracks.nc")
    out = f"--tracks {path} --out {tmp_path / 'plan'}"
    for options, name in (
        ("--current 90 1kn", "--current"),
        ("--error 3NM", "--error"),
        ("--wind-error 4m/s", "--wind-error"),
        ("--current-error 1kn", "--current-error"),
    ):
        message = f"{name} cannot be given together with --tracks, which have it already"
        assert message in refused(capsys, f"{options} {out}")
    again = Incident(tracks=path)
    again.write(tmp_path / "incident.json")
    assert Incident.read(tmp_path / "incident.json") == again


# Files of tracks.


def drifting(path: Path, change: Any = None, count: int = 200, **attributes: str) -> Path:
    """Tracks to the east for two hours."""
    rng = np.random.default_rng(0)
    start = np.array([7.8, 54.2]) + rng.normal(0, 0.01, (count, 1, 2))
    degrees = start + np.linspace(0, 0.02, 121)[:, None] * [1, 0.5]
    if change is not None:
        change(degrees)
    with nc.Dataset(path, "w") as data:
        data.createDimension("trajectory", count)
        data.createDimension("time", 121)
        when = data.createVariable("time", "f8", ("time",))
        when.units = "seconds since 2026-03-01"
        when[:] = 60.0 * np.arange(121)
        for name, values in zip(("lon", "lat"), degrees.transpose(2, 0, 1), strict=True):
            data.createVariable(name, "f8", ("trajectory", "time"))[:] = values
        data.setncatts(attributes)
    return path


def setting(index: Any, value: Any) -> Any:
    def change(degrees: np.ndarray) -> None:
        degrees[index] = value

    return change


TRACKS = {
    "a gap": (setting(np.s_[3, 20:30], np.nan), "tracks without gaps, got .* in element 3 at 2026"),
    "a fill value": (setting(np.s_[3, 20:30], -999.0), "degrees, got .-999, -999. in element 3"),
    "NetCDF's": (setting(np.s_[3, 20:], 9.96921e36), "degrees, got .* in element 3 at 2026-03-01"),
    "(0, 0)": (setting(np.s_[3, 20], 0.0), "tracks near each other, got .0, 0. in element 3"),
    "a start at (0, 0)": (setting(np.s_[3, 0], 0.0), "tracks near each other, got .0, 0."),
    "a jump": (setting(np.s_[3, 20], [7.8, 54.6]), "tracks of at most 15 m/s along each axis, got"),
    "nothing": (setting(np.s_[:], np.nan), "must hold tracks, got no known position"),
}


@pytest.mark.parametrize(("change", "message"), TRACKS.values(), ids=TRACKS)
def test_files_of_tracks_are_refused_by_name(tmp_path, change, message):
    path = drifting(tmp_path / "tracks.nc", change)
    with pytest.raises(ValueError, match=rf"tracks\.nc must hold {message}|{message}"):
        simulate(Incident(tracks=path, start="00:10Z"), 100, 0)


def test_a_plan_needs_some_tracks(tmp_path):
    path = drifting(tmp_path / "tracks.nc", count=1)
    with pytest.raises(ValueError, match=r"tracks must be at least 20.* got 1 in .*tracks\.nc"):
        plan_flights(Incident(tracks=path, start="00:10Z", night=True))


@pytest.mark.thorough
def test_a_longer_flight_than_the_tracks(tmp_path, capsys):
    path = drifting(tmp_path / "tracks.nc")
    assert (
        cli.main(
            f"plan --tracks {path} --drones 1 --night --seconds 1 --out {tmp_path}/plan".split()
        )
        == 0
    )
    text = " ".join(capsys.readouterr().out.split())
    assert "Half an hour more: unknown, beyond the limits of what is given." in text


def test_a_small_file_that_unpacks_to_gigabytes(tmp_path):
    path = tmp_path / "bomb.nc"
    with nc.Dataset(path, "w") as data:
        for name, size in (("time", 24), ("lat", 9000), ("lon", 9000)):
            data.createDimension(name, size)
            axis = data.createVariable(name, "f8", (name,))
            axis[:] = np.linspace(*{"time": (0, 23), "lat": (53, 55), "lon": (6, 9)}[name], size)
            axis.units = {"time": "hours since 2026-03-01", "lat": "degrees_north"}.get(
                name, "degrees_east"
            )
        for name in ("eastward", "northward"):
            field = data.createVariable(name, "f4", ("time", "lat", "lon"), zlib=True)
            field.standard_name = f"{name}_sea_water_velocity"
    assert path.stat().st_size < 2**20
    with pytest.raises(ValueError, match=r"bomb\.nc must have at most 134,217,728 values in a var"):
        Incident(**{**KNOWN, "current": str(path)})
    with pytest.raises(ValueError, match=r"bomb\.nc must have at most 134,217,728 values in a var"):
        Incident(tracks=with_positions(tmp_path / "tracks.nc", path))


def with_positions(path: Path, bomb: Path) -> Path:
    """A file with more positions than memory."""
    with nc.Dataset(path, "w") as data:
        data.createDimension("trajectory", 2**16)
        data.createDimension("time", 2**12)
        data.createVariable("time", "f8", ("time",)).units = "seconds since 2026-03-01"
        for name in ("lon", "lat"):
            data.createVariable(name, "f4", ("trajectory", "time"), zlib=True)
    return path.rename(bomb)


# The folder.


@pytest.fixture
def quick_maps(monkeypatch):
    """Write empty files in place of maps, which take most of the time."""

    def save(plan: FlightPlan, folder: Path) -> None:
        for sheet in range(-(-len(plan.flights) // chart.PER_SHEET)):
            for kind in ("png", "svg"):
                (folder / f"map{sheet + 1 if sheet else ''}.{kind}").write_text("")

    monkeypatch.setattr(chart, "write", save)


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


@pytest.mark.thorough
@pytest.mark.usefixtures("quick_maps")
def test_a_folder_holds_one_plan(plan, small, tmp_path):
    """Files of another plan go, those of other origin stay and are named."""
    assert write(plan, tmp_path / "fresh") == []
    folder = tmp_path / "plan"
    write(small, folder)
    first = names(folder)
    assert first >= {"drone1.plan", "overlay_west.png", "overlay_east.png", "incident.json"}
    (folder / "notes.txt").write_text("mine")
    (folder / "photos").mkdir()
    assert write(plan, folder) == ["notes.txt", "photos"]
    assert names(folder) == {*names(tmp_path / "fresh"), "notes.txt", "photos"}
    write(small, folder)
    assert names(folder) == {*first, "notes.txt", "photos"}
    assert Incident.read(folder / "incident.json") == small.incident


def only_one(plan):
    """The plan for the first drone alone."""
    incident = plan.incident.changed(drones=1)
    return replace(
        plan,
        incident=incident,
        flights=plan.flights[:1],
        searches=plan.searches[:1],
        patterns=plan.patterns[:1],
    )


@pytest.mark.usefixtures("quick_maps")
def test_many_drones_then_one(plan, tmp_path):
    crowd = replace(
        plan,
        incident=plan.incident.changed(drones=9),
        flights=plan.flights * 3,
        searches=plan.searches * 3,
        patterns=plan.patterns * 3,
    )
    write(crowd, tmp_path)
    assert names(tmp_path) >= {"drone9.plan", "map2.png", "map2.svg"}
    one = only_one(plan)
    write(one, tmp_path)
    missions = {"drone1.plan", "drone1.waypoints"}
    assert {name for name in names(tmp_path) if name.startswith("drone")} == missions
    assert not names(tmp_path) & {"map2.png", "map2.svg"}


@pytest.mark.usefixtures("quick_maps")
def test_changed_files_of_an_earlier_plan_stay(plan, tmp_path):
    """They are somebody's work; the map of the new plan takes the place of the old one, though."""
    write(plan, tmp_path)
    (tmp_path / "drone3.plan").write_text("edited")
    (tmp_path / "plan.csv").write_text("what was flown")
    one = only_one(plan)
    assert write(one, tmp_path) == ["drone3.plan"]
    assert (tmp_path / "drone3.plan").read_text() == "edited"
    assert "drone2.plan" not in names(tmp_path)
    assert (tmp_path / "plan.csv").read_text("utf-8").startswith("drone,waypoint")


def test_files_of_other_origin_are_never_replaced(capsys, plan, tmp_path):
    (tmp_path / "plan.csv").write_text("mine")
    with pytest.raises(ValueError, match=r"out must be a folder without files .*plan\.csv"):
        write(plan, tmp_path)
    assert "--out must be a folder without files" in refused(capsys, f"{HERE} --out {tmp_path}")
    assert names(tmp_path) == {"plan.csv"}


@pytest.mark.parametrize("writer", ["chart.write", "missions.write", "gpx", "write_text"])
def test_a_full_disk_leaves_the_earlier_plan(
    plan, small, tmp_path, monkeypatch, writer, quick_maps
):
    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    write(small, tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    monkeypatch.setattr(f"DroneSwarmSearch.incident.files.{writer}", full)
    with pytest.raises(OSError, match="No space left on device") as error:
        write(plan, tmp_path)
    assert error.value.filename == str(tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.usefixtures("quick_maps")
def test_a_plan_that_is_half_moved_is_none(plan, small, tmp_path, monkeypatch):
    """Never are missions of one plan beside the incident of another."""
    write(small, tmp_path)
    moves: list[str] = []
    move = os.replace

    def fails(source: Path, target: Path) -> None:
        moves.append(Path(target).name)
        if "drone2.plan" in moves and Path(target).parent == tmp_path:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        move(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", fails)
        with pytest.raises(OSError, match="Input/output error"):
            write(plan, tmp_path)
    assert "drone1.plan" in moves
    assert "incident.json" not in names(tmp_path)
    write(plan, tmp_path)
    assert Incident.read(tmp_path / "incident.json") == plan.incident


PLACES = {
    "a system folder": lambda folder: Path("/proc/x"),
    "a file": lambda folder: (folder / "file").write_text("") is None or folder / "file",
    "below a file": lambda folder: (folder / "file").write_text("") is None or folder / "file/plan",
}


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs Linux")
@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES)
def test_the_folder_is_tried_first(capsys, tmp_path, monkeypatch, place):
    monkeypatch.setattr(command, "plan", lambda incident: pytest.fail("it planned"))
    out = place(tmp_path)
    assert cli.main(["plan", *HERE.split(), "--out", str(out)]) == 1
    assert str(out) in capsys.readouterr().err


def test_a_full_disk_is_noticed_first(capsys, tmp_path, monkeypatch):
    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(command, "plan", lambda incident: pytest.fail("it planned"))
    monkeypatch.setattr(os, "fsync", full)
    assert cli.main(["plan", *HERE.split(), "--out", str(tmp_path)]) == 1
    assert capsys.readouterr().err == f"{tmp_path}: No space left on device\n"
    assert names(tmp_path) == set()


@pytest.mark.thorough
def test_the_orders_are_printed_before_the_files_are_written(capsys, tmp_path, monkeypatch, plan):
    def fails(made: FlightPlan, folder: Path) -> None:
        raise OSError(errno.EIO, "broken", str(folder))

    monkeypatch.setattr(command, "plan", lambda incident, seconds: plan)
    monkeypatch.setattr(command, "write", fails)
    assert cli.main(["plan", *HERE.split(), "--out", str(tmp_path)]) == 1
    shown = capsys.readouterr()
    assert "PROBABILITY OF SUCCESS" in shown.out
    assert "Written" not in shown.out
    assert shown.err == f"{tmp_path}: broken\n"


# Closed streams, and a backend that Jupyter sets.


@pytest.mark.thorough
@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-"])
def test_closed_streams(closed, tmp_path):
    """Results go to the stream that is left, and the work is done."""
    command = f'"{sys.executable}" -m DroneSwarmSearch evaluate random pond --episodes 2 --csv'
    done = subprocess.run(
        ["bash", "-c", f"{command} --out {tmp_path} {closed}"],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0
    assert "Traceback" not in done.stdout + done.stderr
    assert ("package,suite,policy" in done.stdout + done.stderr) == (closed != ">&- 2>&-")
    assert (tmp_path / "random.csv").is_file()
    bad = subprocess.run(
        ["bash", "-c", f"{command} --episodes 0 {closed}"],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert bad.returncode == 2
    assert "Traceback" not in bad.stdout + bad.stderr


def test_progress_without_standard_error(monkeypatch):
    monkeypatch.setattr(sys, "stderr", None)
    with progress("planning", 1.0) as bar:
        bar(0.5)


@pytest.mark.thorough
@pytest.mark.parametrize(
    "backend", ["module://matplotlib_inline.backend_inline", "none", "", "agg"]
)
def test_figures_use_no_backend_of_pyplot(backend, tmp_path):
    script = (
        "import os\n"
        "from DroneSwarmSearch.evaluation import plots\n"
        "from DroneSwarmSearch.training import log_row, plot_curve\n"
        f"log_row({str(tmp_path / 'a.csv')!r}, steps=1, found=0.5)\n"
        f"plot_curve({str(tmp_path / 'a.csv')!r})\n"
        f"assert os.environ['MPLBACKEND'] == {backend!r}\n"
    )
    environment = {**os.environ, "MPLBACKEND": backend}
    subprocess.run([sys.executable, "-c", script], env=environment, check=True, timeout=60)
    assert (tmp_path / "curve.png").is_file()


# Texts from elsewhere.

TITLES = [
    "\x00\x08 ocean \x1b[31m",
    "$x_$ and $\\frac{",
    "<b>&amp;</b>",
    '"quoted", =1+1',
    "ä" * 300,
]


@pytest.mark.thorough
@pytest.mark.parametrize("title", TITLES, ids=range(len(TITLES)))
def test_any_title_survives_in_every_file(plan, tmp_path, title):
    path = tmp_path / "ocean.nc"
    with nc.Dataset(path, "w") as data:
        data.title = title
        axes = {"time": [0, 12], "lat": [53, 56], "lon": [6, 10]}
        units = ("hours since 2026-03-01", "degrees_north", "degrees_east")
        for (name, values), unit in zip(axes.items(), units, strict=True):
            data.createDimension(name, 2)
            axis = data.createVariable(name, "f8", (name,))
            axis[:] = values
            axis.units = unit
        for name in ("eastward", "northward"):
            field = data.createVariable(name, "f4", tuple(axes))
            field.standard_name = f"{name}_sea_water_velocity"
            field[:] = 0.1
    hostile = replace(plan, incident=Incident(**{**KNOWN, "current": path}))
    write(hostile, tmp_path / "plan")
    kml = ET.parse(tmp_path / "plan" / "plan.kml")
    described = next(each.text for each in kml.iter() if each.tag.endswith("description"))
    assert described == hostile.incident.sentence
    assert described.isprintable()
    ET.parse(tmp_path / "plan" / "plan.gpx")
    ET.parse(tmp_path / "plan" / "map.svg")
    json.loads((tmp_path / "plan" / "plan.geojson").read_text("utf-8"))
    with (tmp_path / "plan" / "plan.csv").open(newline="", encoding="utf-8") as file:
        cells = [cell for row in csv.reader(file) for cell in row]
    assert not any(cell.startswith(("=", "+", "@", "\t")) for cell in cells)


def test_dollar_signs_are_no_formulas(plan, tmp_path):
    path = drifting(tmp_path / "$x_$.nc")
    shown = replace(plan, incident=Incident(tracks=path, position=(54.2, 7.8)))
    texts = [text.get_text() for text in chart.draw(shown, range(3)).axes[0].texts]
    assert any(r"Tracks of \$x_\$.nc" in text for text in texts)


# Words on paper.


def test_orders_say_what_is_flown(plan):
    for number, (flight, text) in enumerate(zip(plan.flights, plan.orders, strict=True), 1):
        assert text.startswith(f"Drone {number}: ")
        order = plan.order(number - 1)
        scene = flight[1]
        after = flight[2]
        metres = plan.incident.plane.metres
        way = metres(after.latitude, after.longitude) - metres(scene.latitude, scene.longitude)
        course = np.degrees(np.arctan2(*way)) % 360
        heading = int(order["first heading"][:3])
        assert abs((heading - course + 180) % 360 - 180) < 1
        assert "1 legs" not in text and " + " not in text
        landing = flight[-1].time
        assert order["landing"] == f"{landing:%H:%M}"
        on_scene = scene.time
        rounded = on_scene.replace(second=0, microsecond=0)
        assert (order["on scene"] == f"{on_scene:%H:%M}") == (on_scene == rounded)


def test_the_times_on_a_chart_are_those_of_its_orders(plan):
    _, labels = chart.draw(plan, range(3)).axes[0].get_legend_handles_labels()
    orders = [plan.order(drone) for drone in range(3)]
    assert f"50% and 90% areas at {min(order['on scene'] for order in orders)}" in labels
    assert f"50% and 90% areas at {max(order['landing'] for order in orders)}" in labels
