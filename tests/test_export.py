"""Episodes as JSON, and those of the documentation."""

import base64
import json
import zlib
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers import module_at
from numpy.typing import NDArray

from DroneSwarmSearch import Action, Drift, DroneSwarmSearch, Person, Scenario
from DroneSwarmSearch import cli as command
from DroneSwarmSearch.core import Frame
from DroneSwarmSearch.evaluation import SUITE, NamedSearch, View, export
from DroneSwarmSearch.rendering import PALETTES

ROOT = Path(__file__).parents[1]
EPISODES = ROOT / "docs" / "static" / "episodes"

pages = module_at(ROOT / "docs" / "make_episodes.py")

MAPS_WITHIN = 0.5 / 100 + 1e-3
"""The rounding of maps and of their maxima, as a share of their maximum."""


def storm(**changes: Any) -> NamedSearch:
    """A short search for two persons, of whom one has two hypotheses."""
    uncertain = Person(
        [
            Drift((3, 3), start_sd=1, vector=(0.05, 0), weight=3),
            Drift((6, 6), start_sd=1, vector=(0, 0.05), diffusion=0.1),
        ],
        probability_of_detection=0.9,
    )
    persons = [uncertain, Person(Drift((4, 4), start_sd=0.7))]
    parameters = {"grid_size": 9, "n_drones": 2, "timestep_limit": 40, "persons": persons}
    return NamedSearch(
        "storm", "For tests.", Scenario(**{**parameters, **changes}), ((4, 4), (8, 0))
    )


def decoded(data: dict[str, Any]) -> NDArray[np.float64]:
    """The maps of a file, shape (count, grid_size, grid_size), as its documentation says."""
    maps = data["maps"]
    size = data["search"]["grid_size"]
    differences = np.frombuffer(zlib.decompress(base64.b64decode(maps["data"])), np.uint8)
    percent = np.add.accumulate(differences.reshape(size**2, maps["count"]), 1, np.uint8)
    shares = percent.T.reshape(-1, size, size) / 100
    return shares * np.array(maps["maxima"])[:, None, None]


def cell_of(place: tuple[int, int], grid_size: int) -> int:
    return place[1] * grid_size + place[0]


def check_against_the_environment(data: dict[str, Any], search: NamedSearch) -> None:
    """The recorded actions give the recorded episodes, in the environment."""
    maps = decoded(data)
    size = search.scenario.grid_size
    assert data["search"]["drones"] == [cell_of(cell, size) for cell in search.drones]
    for episode in data["episodes"]:
        for field in ("prior", "posterior"):
            numbers = episode[field]
            scenario = search.scenario.replace(bayesian_update=field == "posterior")
            env = DroneSwarmSearch(scenario=scenario, render_mode=None)
            env.reset(episode["seed"], drones_positions=search.drones)
            returns = 0.0
            for step in range(episode["steps"] + 1):
                if step:
                    chosen = [int(actions[step - 1]) for actions in episode["actions"]]
                    result = env.step(dict(zip(env.agents, chosen, strict=True)))
                    returns += sum(result[1].values())
                frame = env.frame()
                shown = maps[numbers[step]]
                assert np.abs(shown - frame.matrix).max() < MAPS_WITHIN * frame.matrix.max()
                check_persons(episode, frame, step)
                if field == "posterior" and frame.probability_of_success is not None:
                    success = frame.probability_of_success
                    assert episode["success"][step] == pytest.approx(success, abs=5e-5)
                if scenario.bayesian_update == search.scenario.bayesian_update:
                    assert episode["returns"][step] == pytest.approx(returns, abs=0.051)
            assert not env.agents and frame.ending is not None
            assert frame.ending.name.lower() == episode["ending"]
            for name in ("success", "returns", "prior", "posterior"):
                assert len(episode[name]) == episode["steps"] + 1


def check_persons(episode: dict[str, Any], frame: Frame, step: int) -> None:
    assert len(episode["persons"]) == len(frame.persons)
    for person, place, drone in zip(episode["persons"], frame.persons, frame.found_by, strict=True):
        cells = person["cells"]
        assert cell_of(place, frame.grid_size) == cells[min(step, len(cells) - 1)]
        is_found = person["found_by"] is not None and step >= len(cells) - 1
        assert drone == (person["found_by"] if is_found else None)


class TestFile:
    @pytest.mark.parametrize("changes", [{}, {"bayesian_update": True}, {"mission": "coverage"}])
    def test_it_is_the_episode_of_the_environment(self, tmp_path, changes):
        search = storm(**changes)
        path = tmp_path / "storm.json"
        data = export(["greedy-posterior", "random"], search, path, seeds=[1, 5])
        assert json.loads(path.read_text("utf-8")) == json.loads(json.dumps(data))
        played = [(episode["policy"], episode["seed"]) for episode in data["episodes"]]
        assert played == [*product(("greedy-posterior", "random"), (1, 5))]
        check_against_the_environment(data, search)

    def test_equal_maps_are_stored_once(self, tmp_path):
        def idle(observations: Any) -> dict[str, int]:
            return dict.fromkeys(observations, int(Action.IDLE))

        search = storm(timestep_limit=6)
        idle.view = "parallel"  # type: ignore[attr-defined]
        data = export([idle], search, tmp_path / "idle.json", seeds=range(4))
        assert data["maps"]["count"] == len(data["maps"]["maxima"]) <= 7
        assert all(episode["posterior"] == episode["prior"] for episode in data["episodes"])
        assert {tuple(episode["actions"]) for episode in data["episodes"]} == {("555555",) * 2}

    def test_the_search_is_described(self, tmp_path):
        data = export(["random"], "man-overboard", tmp_path / "a.json")
        search = SUITE["man-overboard"]
        assert (data["format"], data["version"]) == ("DroneSwarmSearch episodes", 1)
        described = data["search"]
        assert (described["name"], described["reason"]) == (search.name, search.reason)
        assert (described["metres_per_cell"], described["seconds_per_step"]) == (150, 10)
        assert (described["grid_size"], described["timestep_limit"]) == (36, 180)
        assert export(["random"], "pond", tmp_path / "b.json")["search"]["metres_per_cell"] is None


class TestErrors:
    @pytest.mark.parametrize(
        ("changed", "error", "words"),
        [
            ({"seeds": [-1]}, ValueError, "seeds must be an integer of at least 0, got -1"),
            ({"view": "both"}, ValueError, "view must be one of 'swarm', 'drone', 'parallel'"),
        ],
    )
    def test_bad_input_is_refused(self, tmp_path, changed, error, words):
        with pytest.raises(error, match=words):
            export(["random"], "pond", tmp_path / "storm.json", **changed)
        assert not list(tmp_path.iterdir())

    def test_an_existing_file_is_kept_if_a_policy_fails(self, tmp_path):
        def failing(observations: Any) -> dict[str, int]:
            raise RuntimeError("no idea")

        path = tmp_path / "storm.json"
        path.write_text("before", "utf-8")
        with pytest.raises(RuntimeError, match="no idea"):
            export(["random", failing], storm(), path, view="parallel")
        assert path.read_text("utf-8") == "before"
        assert list(tmp_path.iterdir()) == [path]


class TestCommand:
    def test_it_writes_the_file(self, tmp_path, capsys):
        path = tmp_path / "pond.json"
        same = tmp_path / "same.json"
        policies = ["parallel-sweep", "greedy-matrix"]
        arguments = ["--policies", *policies, "--seeds", "0", "7", "--posterior"]
        assert command.main(["export", "pond", *arguments, "--out", str(path)]) == 0
        assert capsys.readouterr().out == f"{path}: 4 episodes of pond\n"
        export(policies, "pond", same, seeds=[0, 7], view=View(bayesian_update=True))
        assert path.read_bytes() == same.read_bytes()


@pytest.mark.pictures
class TestDocumentation:
    """The committed episodes, which `docs/make_episodes.py` writes."""

    @staticmethod
    def committed(key: str) -> dict[str, Any]:
        text = (EPISODES / f"{key}.js").read_text("utf-8")
        start = f"(globalThis.searchData ??= {{}})[{json.dumps(key)}] = "
        assert text.startswith(start) and text.endswith(";\n")
        data: dict[str, Any] = json.loads(text[len(start) : -2])
        return data

    def test_the_index_has_the_colours_of_the_palette(self):
        assert self.committed("index") == json.loads(json.dumps(pages.index()))
        ramp = np.array(self.committed("index")["colours"]["map"])
        assert np.array_equal(ramp, PALETTES["sea"])

    @pytest.mark.parametrize("name", pages.SEARCHES)
    def test_they_are_complete(self, name):
        data = self.committed(name)
        assert data["search"]["name"] == name
        played = [(episode["policy"], episode["seed"]) for episode in data["episodes"]]
        assert played == [*product(pages.POLICIES, pages.SEEDS)]
        assert decoded(data).shape[0] == data["maps"]["count"]

    def test_the_command_writes_the_same_today(self, tmp_path):
        policies = ["greedy-posterior", "parallel-sweep"]
        seeds = [0, 1]
        search = SUITE["harbour"]
        today = export(policies, search, tmp_path / "harbour.json", seeds=seeds)
        committed = self.committed("harbour")
        assert today["search"] == committed["search"]
        wanted = {*product(policies, seeds)}
        chosen = [
            each for each in committed["episodes"] if (each["policy"], each["seed"]) in wanted
        ]
        maps = decoded(today)
        committed_maps = decoded(committed)
        for one, other in zip(today["episodes"], chosen, strict=True):
            for field in ("prior", "posterior"):
                shown = maps[one.pop(field)], committed_maps[other.pop(field)]
                np.testing.assert_allclose(*shown, rtol=0, atol=2 * MAPS_WITHIN * shown[0].max())
            for field in ("success", "returns"):
                assert one.pop(field) == pytest.approx(other.pop(field), abs=0.11)
            assert one == other

    def test_the_script_writes_them(self, tmp_path, monkeypatch, capsys):
        monkeypatch.setattr(pages, "EPISODES", tmp_path / "episodes")
        monkeypatch.setattr(pages, "POLICIES", {"parallel-sweep": "Parallel sweep"})
        pages.main(["harbour"])
        written = {path.name for path in (tmp_path / "episodes").iterdir()}
        assert written == {"harbour.js", "index.js"}
        assert "harbour.js" in capsys.readouterr().out
        with pytest.raises(SystemExit):
            pages.main(["harbor"])
        assert "SEARCH must be of man-overboard" in capsys.readouterr().err
