"""Short named episodes, replayed and compared with their traces line by line."""

from dataclasses import replace
from pathlib import Path

import pytest
from golden import regenerate
from golden.regenerate import FOLDER, ID, LETTERS, RELEASED, SCENARIOS, path_of, trace

from DroneSwarmSearch import Action


@pytest.mark.parametrize("name", SCENARIOS)
def test_golden(name):
    path = path_of(name)
    assert path.exists(), f"no trace of {name!r}: run tests/golden/regenerate.py"
    recorded = path.read_text(encoding="utf-8").splitlines()
    replayed = trace(SCENARIOS[name]).splitlines()
    for number, (now, then) in enumerate(zip(replayed, recorded, strict=False), start=1):
        assert now == then, f"{path.name}, line {number}"
    assert len(replayed) == len(recorded)


def test_every_trace_has_a_scenario():
    traces = set(FOLDER.glob("*.txt")) - {RELEASED}
    assert {path.stem for path in traces} == set(SCENARIOS)


def test_the_scenarios_use_every_action_and_reach_every_ending():
    assert set(LETTERS.values()) == set(Action)
    letters = {letter for scenario in SCENARIOS.values() for letter in scenario.steps}
    assert letters - {" "} == set(LETTERS)
    traces = "\n".join(trace(scenario) for scenario in SCENARIOS.values())
    endings = "every person was found; collided; left the grid; the time limit; less than 1%"
    assert [words for words in endings.split("; ") if words not in traces] == []


@pytest.fixture
def other_folder(tmp_path, monkeypatch):
    """A temporary folder of traces, with all scenarios released."""
    monkeypatch.setattr(regenerate, "FOLDER", tmp_path)
    monkeypatch.setattr(regenerate, "RELEASED", tmp_path / "released.txt")
    monkeypatch.setattr(regenerate, "SCENARIOS", dict(SCENARIOS))
    (tmp_path / "released.txt").write_text("drone_swarm_search_v999 find abc\n", encoding="utf-8")
    regenerate.main([])
    assert regenerate.released() == {}
    regenerate.main(["--release"])
    return tmp_path


def kept(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_released_episodes_are_unchanged():
    assert regenerate.broken() == [], "see CONTRIBUTING.md, Versions"


def test_unchanged_episodes_can_be_written_and_released_again(other_folder):
    before = kept(other_folder)
    assert set(before) == {f"{name}.txt" for name in SCENARIOS} | {"released.txt"}
    assert all(before[f"{name}.txt"] == path_of(name).read_bytes() for name in SCENARIOS)
    regenerate.main([])
    regenerate.main(["--release"])
    assert kept(other_folder) == before


def test_changed_episodes_of_a_released_id_are_rejected(other_folder):
    regenerate.SCENARIOS["find"] = replace(SCENARIOS["find"], reset={"seed": 2})
    regenerate.SCENARIOS.pop("persons")
    before = kept(other_folder)
    for arguments in ([], ["--release"]):
        with pytest.raises(SystemExit, match=f"{ID} is released.*: find, persons") as refused:
            regenerate.main(arguments)
        assert '"Versions" in CONTRIBUTING.md' in str(refused.value)
    assert kept(other_folder) == before


def test_new_ids_scenarios_and_frames_are_allowed(other_folder, monkeypatch):
    regenerate.SCENARIOS["find"] = replace(SCENARIOS["find"], shows="Described in other words.")
    regenerate.SCENARIOS["new"] = SCENARIOS["find"]
    monkeypatch.setattr(regenerate, "framed", lambda env, frames: ["a map"] if frames else [])
    regenerate.main([])
    assert "a map" in (other_folder / "new.txt").read_text("utf-8")
    assert set(regenerate.released()) == set(SCENARIOS)
    regenerate.main(["--release"])
    assert set(regenerate.released()) == {*SCENARIOS, "new"}

    monkeypatch.setattr(regenerate, "ID", "drone_swarm_search_v1000")
    regenerate.SCENARIOS["find"] = replace(SCENARIOS["find"], reset={"seed": 2})
    regenerate.main([])
    assert "environment: drone_swarm_search_v1000" in (other_folder / "find.txt").read_text("utf-8")
