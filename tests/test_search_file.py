"""Searches from files, and coverage missions, on the command line."""

import json
import re
import shutil
from typing import Any

import numpy as np
import pytest

from DroneSwarmSearch import Drift, Person, Scale, Scenario, Tracks, cli, priors
from DroneSwarmSearch.evaluation import NamedSearch, evaluate, search

LANE = Scenario(
    9,
    2,
    timestep_limit=10,
    persons=[
        Person([Drift(priors.line(9, [(2, 6), (6, 2)])), Drift((4, 4), start_sd=1)], 0.8),
        Person(Drift((5, 5), vector=(0.1, 0), diffusion=0.1)),
    ],
)


@pytest.fixture
def lane(tmp_path):
    path = tmp_path / "lane.json"
    path.write_text(json.dumps(LANE.to_dict()), "utf-8")
    return path


def test_a_file_holds_a_scenario(lane):
    assert search(str(lane)) == NamedSearch("lane", "Read from a file.", LANE)


def test_a_file_may_hold_a_named_search(tmp_path):
    scale = Scale(130, 13)
    wanted = NamedSearch("ferry", "One fell overboard.", LANE, ((4, 4), (0, 3)), scale)
    data = {
        **wanted.data,
        "name": wanted.name,
        "reason": wanted.reason,
        "scale": {"metres_per_cell": 130, "seconds_per_step": 13},
    }
    path = tmp_path / "any.json"
    path.write_text(json.dumps(data), "utf-8")
    assert search(str(path)) == wanted


def test_a_file_of_tracks_is_relative_to_the_search(tmp_path):
    rng = np.random.default_rng(0)
    positions = np.cumsum(rng.uniform(-0.5, 0.5, (11, 400, 2)), axis=0) + 4
    Tracks(positions).save(tmp_path / "lane.npz")
    digest = Tracks.read(tmp_path / "lane.npz").to_dict()["sha256"]
    person = {"tracks": {"file": "lane.npz", "sha256": digest}, "fine": 1}
    text = json.dumps({"grid_size": 9, "timestep_limit": 10, "persons": [person]})
    (tmp_path / "lane.json").write_text(text, "utf-8")
    shutil.copytree(tmp_path, tmp_path / "elsewhere")
    found, copied = (search(str(tmp_path / part / "lane.json")) for part in ("", "elsewhere"))
    assert found.scenario == copied.scenario
    assert found.data != copied.data
    assert found.fingerprint == copied.fingerprint
    assert Scenario.from_dict(json.loads(json.dumps(found.scenario.to_dict()))) == found.scenario
    Tracks(positions + 1).save(tmp_path / "lane.npz")
    with pytest.raises(ValueError, match=r"lane\.json: persons\[0\]: .* it has changed"):
        search(str(tmp_path / "lane.json"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "Expecting property name"),
        ("[" * 100_000, "JSON must not be nested so deeply"),
        ('{"name": ""}', "name must be text of 1 to 100 printable characters, got ''"),
        ("[1]", "a search is a JSON object, got \\[1\\]"),
        ('{"grid": 3}', "a scenario has the parameters grid_size, .* got 'grid'"),
        ('{"drones_positions": 3}', "drones_positions must be a list of cells, got 3"),
        ('{"drones_positions": [[1, 1], [1, 1]]}', "drones must hold different cells"),
        ('{"drones_positions": [[1, 1]], "n_drones": 2}', "must hold 2 cells"),
        ('{"persons": [{"tracks": {"file": "a.npz", "sha256": ""}}]}', "there is no .*a.npz"),
        ('{"scale": {"metres": 3}}', "scale has the parameters metres_per_cell, .* got 'metres'"),
    ],
)
def test_bad_files(tmp_path, text, message):
    path = tmp_path / "bad.json"
    path.write_text(text, "utf-8")
    with pytest.raises(ValueError, match=rf"{re.escape(str(path))}: .*{message}"):
        search(str(path))


def answer(capsys: Any, *arguments: object) -> str:
    assert cli.main([*map(str, arguments)]) == 0
    return str(capsys.readouterr().out)


def test_tables_of_both_missions(capsys, lane, tmp_path):
    covered = tmp_path / "covered.json"
    covered.write_text(json.dumps(LANE.replace(mission="coverage").to_dict()), "utf-8")
    arguments = ("evaluate", "parallel-sweep", lane, covered, "pond", "--episodes", 5)
    lines = answer(capsys, *arguments, "--out", tmp_path / "out").splitlines()
    assert [line.split()[1] for line in lines[2:4]] == ["lane", "pond"]
    assert "success, %" in lines[0]
    assert lines[5].split()[2] == "POS,"
    assert lines[8].split()[1] == "covered"
    got = evaluate("parallel-sweep", LANE.replace(mission="coverage"), episodes=5)
    assert lines[8].split()[2] == f"{100 * got.success.value:.1f}"  # exact: without an interval
    assert lines[8].split()[4] == f"{100 * got.coverage_rate.value:.1f}"


def test_searches_must_have_different_names(capsys, lane, tmp_path):
    other = tmp_path / "other" / lane.name
    other.parent.mkdir()
    other.write_text(json.dumps({"grid_size": 5}), "utf-8")
    for arguments in (["evaluate", "random"], ["bound"], ["leaderboard", "--searches"]):
        with pytest.raises(SystemExit):
            cli.main([*arguments, str(lane), str(other)])
        assert "different names, got lane, lane" in capsys.readouterr().err
