"""`Scenario`: validated in its constructor, and accepted wherever a search is needed."""

import dataclasses
import inspect
import json
import pickle
from typing import Any

import numpy as np
import pytest

from DroneSwarmSearch import Drift, DroneSwarmSearch, Person, RewardScheme, Scenario
from DroneSwarmSearch.evaluation import View, evaluate
from DroneSwarmSearch.vector import SearchBatch, SwarmVectorEnv

OTHER: dict[str, Any] = {
    "grid_size": 9,
    "n_drones": 2,
    "vector": (0.2, -0.1),
    "person_initial_position": ((3, 4), (5, 5)),
    "disperse_constant": 2.5,
    "timestep_limit": 12,
    "probability_of_detection": (0.5, 0.25),
    "bayesian_update": True,
    "reward_scheme": RewardScheme(find=3.0),
}
TWO = [Person([Drift((1, 1)), Drift((2, 2))], 0.3), Person(Drift((3, 1)))]

LAST = ["mission", "shared_drift", "crash", "radio_range", "search_in_flight"]


def test_names_and_defaults_match_the_environment():
    of_environment = inspect.signature(DroneSwarmSearch).parameters
    of_scenario = inspect.signature(Scenario).parameters
    own = {"render_mode", "render_grid", "render_gradient", "palette", "scenario", "render_drone"}
    assert list(of_scenario) == [name for name in of_environment if name not in own]
    assert list(of_scenario) == [*OTHER, "persons", *LAST]
    assert Scenario() == DroneSwarmSearch().scenario
    keyword_only = [each.name for each in of_scenario.values() if each.kind is each.KEYWORD_ONLY]
    assert keyword_only == list(of_scenario)[6:]


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [("grid_size", 1, ValueError), ("vector", 3, TypeError), ("reward_scheme", {}, TypeError)],
)
def test_bad_values_are_rejected_wherever_a_scenario_is_made(name, value, error):
    usual = Scenario()
    for make_one in (
        lambda: Scenario(**{name: value}),
        lambda: usual.replace(**{name: value}),
        lambda: dataclasses.replace(usual, **{name: value}),
        lambda: DroneSwarmSearch(**{name: value}),
    ):
        with pytest.raises(error, match=rf"{name}.* got"):
            make_one()
    assert usual == Scenario()


def test_equal_values_in_different_forms_are_equal():
    forms = [
        Scenario(9, 2, (1, 0), (3, 4), 2, 12, probability_of_detection=1),
        Scenario(np.int64(9), 2, [1.0, 0], [[3, 4]], 2.0, 12, probability_of_detection=1.0),
        Scenario(9, 2, np.array([1, 0]), np.array([(3.0, 4.0)]), np.float32(2), np.uint8(12)),
    ]
    assert forms[0] == forms[1] == forms[2]
    assert len({*forms}) == 1
    assert repr(forms[0]) == repr(forms[2])
    assert [type(value) for value in dataclasses.astuple(forms[2])[:2]] == [int, int]
    with pytest.raises(dataclasses.FrozenInstanceError):
        forms[0].grid_size = 8  # type: ignore[misc]


@pytest.mark.parametrize("parameters", [{}, OTHER, {"persons": TWO}])
def test_dicts_round_trip(parameters):
    scenario = Scenario(**parameters)
    text = json.dumps(scenario.to_dict(), allow_nan=False)
    for same in (Scenario.from_dict(json.loads(text)), pickle.loads(pickle.dumps(scenario))):
        assert same == scenario and hash(same) == hash(scenario)
    assert list(scenario.to_dict()) == [*OTHER, "persons", *LAST]
    assert Scenario.from_dict({"grid_size": 9}) == Scenario(9)


@pytest.mark.parametrize(
    ("data", "error", "message"),
    [
        ({"gird_size": 9}, ValueError, r"parameters grid_size, .* got 'gird_size'"),
        ({"grid_size": "9"}, TypeError, "grid_size .* got '9'"),
        (
            {"reward_scheme": {"finds": 1}},
            TypeError,
            "RewardScheme .* 'finds'; did you mean find",
        ),
        (
            {"persons": [{"drifts": [{"start": [1, 1]}]}, {"drifts": [{"start": [1]}]}]},
            ValueError,
            r"persons\[1\]: drifts\[0\]: start must be a cell",
        ),
    ],
)
def test_bad_dicts_are_rejected(data, error, message):
    with pytest.raises(error, match=message):
        Scenario.from_dict(data)


@pytest.mark.parametrize("name", ["grid_size", "person_initial_position", "reward_scheme"])
def test_parameters_together_with_a_scenario_are_rejected(name):
    scenario = Scenario(**OTHER)
    value = OTHER[name]
    for kind in (
        DroneSwarmSearch,
        *(lambda each=each, **given: each(2, **given) for each in (SearchBatch, SwarmVectorEnv)),
    ):
        with pytest.raises(ValueError, match=rf"{name} .*with a scenario, got.*replace\({name}="):
            kind(scenario=scenario, **{name: value})


def test_defaults_may_be_given_together_with_a_scenario():
    scenario = Scenario(**OTHER)
    usual = {"vector": np.array([-0.5, -0.5]), "person_initial_position": [[0, 0]], "grid_size": 7}
    assert DroneSwarmSearch(scenario=scenario, **usual).scenario == scenario
    for kind in (DroneSwarmSearch, lambda **given: SearchBatch(2, **given)):
        for other in ({}, 7, DroneSwarmSearch(), "classic"):
            with pytest.raises(TypeError, match="scenario must be a Scenario, got"):
                kind(scenario=other)
        with pytest.raises(ValueError, match=r"vector .*together"):
            kind(scenario=scenario, vector=[[1, 2], [3]])


@pytest.mark.thorough
def test_the_success_rates_of_the_example_are_as_documented():
    env = DroneSwarmSearch.example()
    assert (env.grid_size, env.n_drones, env.timestep_limit) == (15, 3, 60)
    env.reset(seed=0)
    assert not {*env.frame().drones} & {*env.scenario.person_initial_position}
    usual: dict[str, Any] = {"episodes": 1000, "progress": False}
    random, prior, posterior = (
        evaluate(name, env.scenario, view=View(bayesian_update=updates), **usual).success.value
        for name, updates in (("random", False), ("greedy-matrix", False), ("greedy-matrix", True))
    )
    assert random < 0.1
    assert DroneSwarmSearch.example(n_drones=2).scenario == env.scenario.replace(n_drones=2)
    assert (round(prior, 2), round(posterior, 2)) == (0.89, 0.95)  # as in the docstring
