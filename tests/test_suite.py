"""The suite of searches, whose parameters never change."""

import re
from pathlib import Path

import numpy as np
import pytest
from helpers import module_at

from DroneSwarmSearch import Scenario, Tracks, policies
from DroneSwarmSearch.evaluation import SUITE, NamedSearch, evaluate, search, share_found, suite
from DroneSwarmSearch.evaluation.suite import SUITE_VERSION
from DroneSwarmSearch.vector import SearchBatch

FINGERPRINTS = {
    "pond": "6077208585e88eb8331daf8208a9f9a6e0f6220e24baf2bea54410069e9af03b",
    "dsse-2024": "16fafce4ce2ed78f9a4ec9f0ecaed22aac7a023d4eee46e3c288380b31fd9236",
    "classic": "407a5e20f24762eb157041712926fa97005d537f5f81f18492400ba8c358f688",
    "harbour": "633215706d98da389a66750484876b2bcbea5ab1660c284e05c24f3b63281481",
    "fog": "d6578375c42c727ec70849a8da73fdd4d7e99ddef6378a2a69b65bb1385b35af",
    "man-overboard": "b6b6153b150487b0ffa6558c5c83ac5131ecbebee3a42338bf8ac5b939d05240",
    "gale": "e9c88283b059e7d6ebf5511e951f6565f3a45fd6234f795a0f55926c03b3ed21",
    "channel": "74406a3b6f5a7f22ea87bbe539374cba29e34e023614c20aadeb1e0e30c34334",
    "two-positions": "d144ddeb9d33a20eeeede7e3795791c2cec028772a8e10722dc2287d8f6b3184",
    "wreck": "84a0eb04274738e201be433d7a743e6211e33555fe030f454f2f9f56e2d80492",
    "night": "e70739bad001496757cb9e747f49c89d51d7f31e6c6773a2807667d6b7307bec",
    "overdue": "77589ef1ada09d4def073346084119bfa712cf4d6a012e4d08870dce8470aa11",
    "fleet": "469e91d0d04ae9296a6ef1d9dfeba9e6ca4df1b2afb4facbffe74d4d3f4f2bcc",
    "tide": "3a3c0f770893b23ab3dacfb5670eb10e7fac2c99f38cb4942c522c1005b1af0b",
    "eddy": "7b25a961216f2d1ac57dd4900e1d9e25f9084b41fa23cb9fc3a9f928e5957256",
    "coast": "adda3895cfac73655774369f69486411d7c4df107aa09bf965d26ee8fd8d2a6c",
}
"""If these change, results are no longer comparable: make a new version of the suite."""

DOCS = Path(__file__).parents[1] / "docs"
maker = module_at(DOCS / "make_suite.py")
simulator = module_at(DOCS / "make_tracks.py")

TWO_DRONES = Scenario(5, n_drones=2, person_initial_position=(2, 2), timestep_limit=9)


def test_the_suite_never_changes():
    assert SUITE_VERSION == "v2"
    assert {name: each.fingerprint for name, each in SUITE.items()} == FINGERPRINTS
    assert list(SUITE) == list(FINGERPRINTS)  # tables keep their order


def test_the_file_is_what_its_script_writes():
    assert maker.FILE.read_text("utf-8") == maker.text()
    assert maker.FILE.stat().st_size < 200_000


@pytest.mark.parametrize("name", list(SUITE))
def test_every_search_can_be_played_and_has_a_reason(name):
    each = search(name)
    assert re.fullmatch("[a-z]+(-[a-z0-9]+)*", name)
    assert each.name == name
    assert each.reason.endswith(".")
    assert not each.scenario.bayesian_update
    batch = SearchBatch(2, **each.parameters)
    batch.reset([0, 1])
    assert batch.scenario_of(0) == each.scenario
    assert [tuple(cell) for cell in batch.positions[0].tolist()] == list(each.drones)


def test_files_of_tracks_are_read_when_a_search_is_used(monkeypatch):
    def refuse(*_):
        raise LookupError("read")

    monkeypatch.setattr(Tracks, "from_dict", refuse)
    fresh = module_at(Path(suite.__file__))
    assert list(fresh.SUITE) == list(FINGERPRINTS)
    assert fresh.search("pond").fingerprint == FINGERPRINTS["pond"]
    with pytest.raises(LookupError):
        fresh.search("tide")


@pytest.mark.thorough
@pytest.mark.parametrize("name", list(simulator.SCENES))
def test_new_tracks_of_the_script_are_where_those_of_the_suite_are(name):
    found = search(name)
    (person,) = found.scenario.persons_to_find
    assert (len(person.drift.tracks), person.drift.tracks.steps) == (
        simulator.TRACKS,
        simulator.STEPS,
    )
    assert (found.scenario.grid_size, found.scale) == (simulator.GRID_SIZE, simulator.SCALE)
    count = 1000
    new = simulator.simulate(simulator.SCENES[name], count, seed=1)
    for step in range(0, simulator.STEPS + 1, 35):
        ours = person.drift.tracks.positions[step]
        theirs = new.positions[step]
        error = 5 * ours.std(axis=0) / count**0.5
        assert (abs(ours.mean(axis=0) - theirs.mean(axis=0)) < error).all()
    policy = policies.make("greedy-posterior", found.scenario)
    promised = evaluate(policy, found, episodes=1).success.value
    assert share_found(new, policy, drones_positions=found.drones) == pytest.approx(
        promised, abs=0.06
    )


def test_an_outline_has_the_main_parameters():
    assert search("fog").outline == (
        "20 x 20 cells; 4 drones; 1 person; probability of detection 0.4; 100 steps"
    )
    assert search("wreck").outline == (
        "30 x 30 cells of 200 m; 3 drones; 2 persons with up to 2 hypotheses; "
        "probability of detection 0.94, 0.51; 150 steps of 10 s (25 minutes)"
    )
    assert "; 4 drones; 1 person from 30,000 tracks; probability" in search("eddy").outline


def test_an_unknown_name_is_refused():
    with pytest.raises(
        ValueError, match=r"pond, .*got 'harbor'; did you mean harbour.*evaluate --list"
    ):
        search("harbor")


@pytest.mark.parametrize(
    ("drones", "message"),
    [
        (((0, 0),), "drones must hold 2 cells"),
        (np.array([[0, 0], [1, 5]]), r"drones\[1\] must be a cell"),
        (((0, 0), (0, 0)), r"different cells, got \(0, 0\) for both drone0 and drone1"),
        (((0, 0), (5, 0)), r"from 0 to 4, got \(5, 0\)"),
    ],
)
def test_drones_that_do_not_fit_are_refused(drones, message):
    with pytest.raises(ValueError, match=message):
        NamedSearch("mine", "Mine.", TWO_DRONES, drones)
