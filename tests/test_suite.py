"""The suite of searches, whose parameters never change."""

from __future__ import annotations

import dataclasses
import json
import re
from itertools import pairwise

import numpy as np
import pytest

from DroneSwarmSearch import Drift, Person, RewardScheme
from DroneSwarmSearch.evaluation import SUITE, NamedSearch, search
from DroneSwarmSearch.evaluation.suite import SUITE_VERSION, as_named
from DroneSwarmSearch.scenario import Scenario
from DroneSwarmSearch.vector import SearchBatch

FINGERPRINTS = {
    "pond": "6a6ad0222c82d5da22bde2a334e6ad261614318da9e5fbf2e2eeb7fd73b29777",
    "lagoon": "dee1d5a88a3f7bae787f471852f929054b0ee156751ef7cab1e5c8db400890be",
    "classic": "39f3e4d7ede4d588ce7c4e6d4db839070377f8831e7a380739a1c40dce14b72f",
    "open-sea": "1656df0816e5667d40ae59993a750828eaf803c8bc8ad688a612755b7ec1d5e1",
    "channel": "eb3089eacb25c1b29493fc245ccb1b919b03d92954d36290d43cce71625b8925",
    "gale": "a6a19d4ce7bd7737eb1a715bcac11342d9d2f76c3fef7eaf61ba5bb65d8c246d",
    "harbour": "98ae8aa28431a362de89045830ee1e41de1c6b7e1738e5f16102ff78c8db9a11",
    "fog": "2e43031e0615dde3bdd4c23d3ab74a7e88d608a4b1c95fb2f8cef3129caec9c3",
    "night": "a4e6e18bcca26980fd621ee0cad4de397581333575d62fadda12b888998031ad",
    "two-rafts": "9f52d03063dabe6c33f9eb34d210a4bd84e8bcfac0125b3a882a1c1a963647ef",
    "wreck": "6979f95b4dd6d651b17a8e06379b9afffb46ef6e0a750d6b79a9569f50e9c6ec",
    "fleet": "52100d1830b7034acc059951537b57159558714f1f6200b925647b5cee0058f2",
    "long-watch": "817b2fa103f6c0a62483e8a70604d8b8bd0d17e0631380d8060e3bd2f8c6a0f9",
}
"""If these change, results are no longer comparable: make a new version of the suite."""

LEFT_TO_RIGHT = {"pond", "lagoon", "open-sea", "channel", "harbour", "wreck"}


def scenario(**changes: object) -> Scenario:
    return Scenario(
        **{
            "grid_size": 5,
            "n_drones": 2,
            "vector": (0, 0),
            "person_initial_position": (2, 2),
            "disperse_constant": 1,
            "timestep_limit": 9,
            "probability_of_detection": 1,
            "bayesian_update": False,
            "reward_scheme": RewardScheme(),
            **changes,
        }
    )


def test_the_suite_never_changes():
    assert SUITE_VERSION == "v1"
    assert {name: each.fingerprint for name, each in SUITE.items()} == FINGERPRINTS
    assert list(SUITE) == list(FINGERPRINTS)  # tables keep their order


def test_every_parameter_changes_the_fingerprint():
    usual = search("two-rafts")
    changed = [
        dataclasses.replace(usual, scenario=dataclasses.replace(usual.scenario, **change))
        for change in (
            {"grid_size": 26},
            {"vector": (0.1, 0.0500001)},
            {"person_initial_position": ((8, 8), (16, 16))},
            {"disperse_constant": 4.5},
            {"timestep_limit": 151},
            {"probability_of_detection": 0.99},
            {"bayesian_update": True},
            {"reward_scheme": RewardScheme(step=2)},
        )
    ]
    changed.append(dataclasses.replace(usual, drones=((12, 0), (24, 12), (12, 24), (0, 11))))
    words = {each.fingerprint for each in [usual, *changed]}
    assert len(words) == 10
    assert dataclasses.replace(usual, name="other", reason="other").fingerprint in words


def uncertain(*drifts: Drift, **changes: object) -> NamedSearch:
    """A search for a person with some hypotheses."""
    person = Person(drifts or [Drift((2, 1), start_sd=1), Drift((3, 3), weight=2)], 0.8)
    return NamedSearch("mine", "Mine.", Scenario(5, 2, persons=(person,), **changes))


def test_every_parameter_of_a_person_changes_the_fingerprint():
    drift = Drift((2, 1))
    searches = [
        uncertain(drift),
        uncertain(Drift((2, 2))),
        uncertain(Drift((2, 1), start_sd=0.5)),
        uncertain(Drift((2, 1), vector=(0.1, 0))),
        uncertain(Drift((2, 1), vector_sd=0.1)),
        uncertain(Drift((2, 1), diffusion=0.1)),
        uncertain(Drift((2, 1), adrift=1)),
        uncertain(Drift(np.ones((5, 5)))),
        uncertain(drift, drift),
        uncertain(drift, mission="coverage"),
        NamedSearch("mine", "Mine.", Scenario(5, 2, persons=Person(drift, 0.7))),
        NamedSearch("mine", "Mine.", Scenario(5, 2, persons=[Person(drift, 0.8)] * 2)),
    ]
    assert len({each.fingerprint for each in searches}) == len(searches)
    assert uncertain(drift).fingerprint == searches[0].fingerprint
    for each in searches:
        parameters = json.loads(json.dumps(each.data))
        parameters.pop("drones_positions")
        assert Scenario.from_dict(parameters) == each.scenario


def test_outlines():
    assert search("two-rafts").outline.startswith(
        "25 x 25 cells; 4 drones; 2 persons; drift (0.1, 0.05); disperse constant 4; "
    )
    assert uncertain(mission="coverage").outline == (
        "5 x 5 cells; 2 drones; coverage for 1 person; 2 hypotheses with mean drift (0, 0); "
        "probability of detection 0.8; 100 steps"
    )
    drift = Drift((2, 2), vector=(0.1234567, 0))
    assert "; 1 person; 1 hypothesis with mean drift (0.123, 0); " in uncertain(drift).outline


@pytest.mark.parametrize("name", list(SUITE))
def test_every_search_can_be_played_and_has_a_reason(name):
    each = search(name)
    assert re.fullmatch("[a-z]+(-[a-z]+)*", name)
    assert each.name == name
    assert each.reason.endswith(".")
    assert not each.scenario.bayesian_update
    batch = SearchBatch(2, **each.parameters)
    batch.reset([0, 1])
    assert batch.scenario == each.scenario
    assert [tuple(cell) for cell in batch.positions[0].tolist()] == list(each.drones)


def test_drones_start_in_their_cells():
    for name, each in SUITE.items():
        n, last = each.scenario.n_drones, each.scenario.grid_size - 1
        if name in LEFT_TO_RIGHT:
            assert each.drones == tuple((x, 0) for x in range(n))
        elif name == "fleet":
            rows = [y for x, y in each.drones if x == 0]
            gaps = [below - above for above, below in pairwise(rows)]
            assert len(rows) == 16
            assert {*gaps} == {3, 4}
            assert rows[0] + rows[-1] == last
        else:
            half = each.scenario.grid_size // 2
            assert {*each.drones} <= {(half, 0), (last, half), (half, last), (0, half)}
            assert len(each.drones) == n


def test_reasons_are_all_different():
    assert len({each.reason for each in SUITE.values()}) == len(SUITE)


def test_an_unknown_name_suggests_similar_names():
    with pytest.raises(
        ValueError, match=r"pond, .*got 'lagun'; did you mean lagoon.*evaluate --list"
    ):
        search("lagun")
    with pytest.raises(ValueError, match="got 'Classic'; did you mean classic"):
        search("Classic")
    with pytest.raises(ValueError, match="got 'xyzzy' "):
        search("xyzzy")
    with pytest.raises(TypeError, match="search must be the name of a search, got 3"):
        search(3)  # type: ignore[arg-type]


def test_with_posterior_only_changes_what_drones_see():
    each = search("fog").with_posterior(True)
    assert each.scenario.bayesian_update
    assert each.with_posterior(False) == search("fog")
    with pytest.raises(TypeError, match="bayesian_update must be True or False, got 1"):
        search("fog").with_posterior(1)


def test_searches_are_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        search("pond").name = "puddle"  # type: ignore[misc]
    with pytest.raises(TypeError):
        SUITE["pond"] = search("fog")  # type: ignore[index]


def test_a_scenario_becomes_a_named_search():
    named = as_named(scenario())
    assert named.drones == ((0, 0), (1, 0))
    assert as_named(named) is named
    assert as_named("pond") is SUITE["pond"]
    with pytest.raises(TypeError, match="a name of the suite, a NamedSearch or a Scenario, got 7"):
        as_named(7)


@pytest.mark.parametrize(
    ("drones", "message"),
    [
        (((0, 0),), "drones_positions"),
        (((0, 0), (0, 0)), r"different cells, got \(0, 0\) for both drone0 and drone1"),
        (((0, 0), (5, 0)), r"from 0 to 4, got \(5, 0\)"),
    ],
)
def test_drones_that_do_not_fit_are_refused(drones, message):
    with pytest.raises(ValueError, match=message):
        NamedSearch("mine", "Mine.", scenario(), drones)


def test_a_search_needs_a_scenario():
    with pytest.raises(TypeError, match="scenario must be a Scenario, got None"):
        NamedSearch("mine", "Mine.", None)  # type: ignore[arg-type]
