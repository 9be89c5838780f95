"""What a policy sees, wherever one plays: evaluate, record, export, play."""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from DroneSwarmSearch import Action, Scale, Scenario, cli
from DroneSwarmSearch.evaluation import SUITE, NamedSearch, View, evaluate, export, record, search
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.stage import view_of


def small(n_drones: int = 2) -> NamedSearch:
    scenario = Scenario(6, n_drones, person_initial_position=(3, 3), timestep_limit=12)
    return NamedSearch("small", "For tests.", scenario)


def swarm(shown: Any) -> Any:
    return np.full(shown["positions"].shape[:2], int(Action.SEARCH))


def drone(shown: Any) -> Any:
    return np.full(len(shown["position"]), int(Action.SEARCH))


def parallel(shown: Any) -> dict[str, int]:
    return {each: int(Action.SEARCH) for each in shown if shown[each]["observation"]}


def anything(shown: Any) -> Any:
    """Valid for the rows of any layout, whatever it shows."""
    return np.full(len(shown), int(Action.SEARCH))


# type: ignore[attr-defined]
drone.view = View("drone")
parallel.view = "parallel"


@pytest.mark.thorough
@pytest.mark.parametrize("n_drones", [1, 2])
@pytest.mark.parametrize("policy", [swarm, drone, parallel])
def test_policies_see_what_they_state_and_otherwise_swarms(policy, n_drones):
    got = evaluate(policy, small(n_drones), episodes=20, progress=False)
    form = policy.__name__
    told = evaluate(
        lambda shown: policy(shown), small(n_drones), view=form, episodes=20, progress=False
    )
    assert np.array_equal(got.episodes.found_at, told.episodes.found_at)
    assert got.view.form in (form, None)


def test_who_states_no_view_is_told_how_to():
    hint = "give it an attribute view, such as view = View"
    episodes = {"episodes": 2}
    with pytest.raises(ValueError, match=rf"the policy's actions must be integers .*; .* {hint}"):
        evaluate(lambda shown: 4, small(), name="4", **episodes)
    with pytest.raises(KeyError, match="position") as told:
        evaluate(lambda shown: shown["position"], small(), **episodes)
    assert sys.version_info < (3, 11) or hint in told.value.__notes__[0]


@pytest.mark.parametrize("stated", ["drone", View("drone")])
def test_a_view_may_be_stated_by_its_form(stated):
    def policy(shown: Any) -> Any:
        return drone(shown)

    policy.view = stated  # type: ignore[attr-defined]
    assert evaluate(policy, small(), episodes=2, progress=False).view == View("drone")
    policy.view = 3  # type: ignore[attr-defined]
    with pytest.raises(TypeError, match="view must be one of 'swarm', 'drone', 'parallel', got 3"):
        evaluate(policy, small(), episodes=2, progress=False)


class Stating:
    """A policy that states what it sees; checks it, and searches."""

    view = View("drone", "crops", action_mask=True, right_of_way=True, bayesian_update=True)

    def __init__(self, scenario: Scenario, note: str = "") -> None:
        assert scenario.grid_size
        self.note = note

    def __call__(self, shown: Any) -> Any:
        assert shown["observation"].shape[1] == 202
        assert shown["action_mask"].shape[1] == 6
        return np.full(len(shown["observation"]), int(Action.SEARCH))


def test_a_policy_states_its_view():
    assert evaluate(Stating, small(), episodes=2, progress=False).view == Stating.view
    changed = view_of(PolicySpec.of(Stating), small(), View(bayesian_update=False))
    assert changed == View("drone", "crops", True, True, bayesian_update=False)


def test_a_class_gets_the_argument_behind_it():
    for note in ("runs/a.pt", "a.zip", "a.npz"):
        spec = PolicySpec.of(f"{__file__}:Stating:{note}")
        assert spec.make(small().scenario).note == note
    assert PolicySpec.of(f"{__file__}:Stating").make(small().scenario).note == ""


def test_videos_and_files_take_what_evaluate_takes(tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    assert record(Stating, small(), tmp_path / "a.gif", fps=50).last.ending
    data = export([Stating, parallel], small(), tmp_path / "a.json")
    assert [each["policy"] for each in data["episodes"]] == ["Stating", "parallel"]
    file = f"{__file__}:anything"
    out = str(tmp_path / "b.json")
    assert (
        cli.main(
            [
                "export",
                "pond",
                "--policies",
                file,
                "--view",
                "drone",
                "--observation",
                "flat",
                "--out",
                out,
            ]
        )
        == 0
    )


def test_play_takes_what_evaluate_takes(capsys):
    for arguments in (
        ["drone"],
        ["Stating"],
        ["anything", "--view", "drone", "--observation", "planes"],
    ):
        mine = f"{__file__}:{arguments[0]}"
        assert cli.main(["play", "pond", "--text", "--policy", mine, *arguments[1:]]) == 0
        assert f"policy          {mine}" in capsys.readouterr().out


@pytest.mark.parametrize("each", ["man-overboard", "two-positions", "coast"])
def test_a_search_is_saved_and_read(tmp_path, monkeypatch, each):
    monkeypatch.chdir(tmp_path)
    SUITE[each].save("here.json")
    assert search("here.json").fingerprint == SUITE[each].fingerprint
    assert search("here.json").reason == SUITE[each].reason


def test_a_saved_search_keeps_its_scale(tmp_path):
    path = Path(tmp_path, "a", "b.json")
    where = NamedSearch("a", "b", Scenario(), ((2, 2),), Scale(50.0, 5.0))
    where.save(path)
    assert search(str(path)).scale == where.scale
    assert json.loads(path.read_text("utf-8"))["drones_positions"] == [[2, 2]]
