"""Bad input raises an error that names it, and leaves the environment unchanged."""

import copy
import os
import random
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers import observed, plain, play, play_on, whole_state

import DroneSwarmSearch as package
from DroneSwarmSearch import (
    Action,
    DroneSwarmSearch,
    Person,
    ResetNeeded,
    RewardScheme,
    Scale,
    Scenario,
    Tracks,
)
from DroneSwarmSearch.drift import ProbabilityMatrix
from DroneSwarmSearch.evaluation import evaluate
from DroneSwarmSearch.persons import Drift
from DroneSwarmSearch.policies import make
from DroneSwarmSearch.vector import DroneVectorEnv, SearchBatch, SwarmVectorEnv
from DroneSwarmSearch.wrappers import action_masks

NAN = float("nan")
INF = float("inf")
PERSON = "person_initial_position"
POD = "probability_of_detection"
DRONES = "drones_positions"

# The parameter, the bad value, the error, and the value as the message shows it
# (by default its repr). The grid has 7 x 7 cells.
CONSTRUCTOR: list[tuple[Any, ...]] = [
    ("grid_size", 1, ValueError),
    ("grid_size", 7.0, TypeError),
    ("n_drones", 0, ValueError),
    ("n_drones", 50, ValueError),
    ("timestep_limit", 0, ValueError),
    ("timestep_limit", 10**40, ValueError, str(2**53)),
    ("vector", (NAN, 0), ValueError, "nan"),
    ("vector", np.zeros(3), ValueError, "array([0., 0., 0.])"),
    ("vector", ("0.5", 0), TypeError, "'0.5'"),
    ("vector", (True, 0), TypeError, "True"),
    (PERSON, (7, 0), ValueError, "7, 0"),
    (PERSON, (1, 2, 3), ValueError, "1, 2, 3"),
    (PERSON, [], ValueError),
    (PERSON, [(0, 0), (0, 7)], ValueError, "(0, 7)"),
    ("disperse_constant", -0.1, ValueError),
    (POD, 1.01, ValueError),
    (POD, (0.5, 0.5), ValueError),
    ("render_mode", "Human", ValueError),
    ("render_grid", 1, TypeError),
    ("palette", "ocean", ValueError, "one of 'sea', 'classic'"),
    ("bayesian_update", 0, TypeError),
    ("reward_scheme", {"step": 1}, TypeError),
    ("mission", "picnic", ValueError, "one of 'rescue', 'coverage'"),
]

# The same for reset, with three drones and two persons with a POD each; names that are not
# arguments of reset are options.
RESET: list[tuple[Any, ...]] = [
    ("seed", -1, ValueError),
    ("seed", 1.0, TypeError),
    ("options", [("vector", (0, 0))], TypeError),
    ("vector", (0, NAN), ValueError, "nan"),
    (DRONES, [(0, 0), (1, 0), (0, 7)], ValueError, "(0, 7)"),
    (DRONES, [(3, 4), (1, 0), (3, 4)], ValueError, "(3, 4) for both drone0 and drone2"),
    (DRONES, {"drone0": (0, 0)}, TypeError),
    (PERSON, (7, 7), ValueError, "7, 7"),
    (PERSON, [(0, 0)], ValueError),
]

GOOD = {"drone0": 4, "drone1": 4, "drone2": 5}

# Actions for three drones, the error, and a part of the message.
STEP: list[tuple[Any, type[Exception], tuple[str, ...]]] = [
    ({**GOOD, "drone1": 6}, ValueError, ("actions['drone1']", "6", "from 0 to 5")),
    ({**GOOD, "drone0": 10**30}, ValueError, ("actions['drone0']", str(10**30))),
    ({**GOOD, "drone0": np.int8(-1)}, ValueError, ("actions['drone0']", "-1")),
    ({**GOOD, "drone1": np.float64(4)}, TypeError, ("actions['drone1']", "4.0")),
    ({**GOOD, "drone1": True}, TypeError, ("actions['drone1']", "True")),
    ({**GOOD, "drone1": np.array([4, 4])}, TypeError, ("actions['drone1']", "array([4, 4])")),
    ({"drone0": 4, "drone1": 4}, ValueError, ("actions", "'drone2'")),
    ({**GOOD, 0: 4}, ValueError, ("actions", "got one for 0")),
    ([4, 4, 5], TypeError, ("actions", "[4, 4, 5]")),
]


def make_env(**changes: Any) -> DroneSwarmSearch:
    """An environment that uses all its random streams and all its state."""
    parameters: dict[str, Any] = {
        "n_drones": 3,
        "person_initial_position": [(3, 3), (5, 2)],
        "probability_of_detection": [0.3, 0.6],
        "bayesian_update": True,
        "timestep_limit": 15,
    }
    return DroneSwarmSearch(**{**parameters, **changes})


def in_mid_episode() -> DroneSwarmSearch:
    env = make_env()
    env.reset(seed=5, vector=(0.25, 0.5), drones_positions=[(3, 3), (5, 2), (0, 6)])
    for _ in range(5):
        env.step(GOOD)
    assert env.agents
    return env


def after_the_end() -> DroneSwarmSearch:
    env = in_mid_episode()
    while env.agents:
        env.step({**GOOD, "drone2": Action.DOWN})
    return env


STAGES = [make_env, in_mid_episode, after_the_end]


def refused(call: Callable[[], Any], error: type[Exception], *said: str) -> None:
    with pytest.raises(error) as caught:
        call()
    assert type(caught.value) is error
    for words in said:
        assert words in str(caught.value)


def assert_untouched(env: DroneSwarmSearch, call: Callable[[DroneSwarmSearch], None]) -> None:
    """Check that a failing call changes neither the state nor the rest of the episode."""
    twin = copy.deepcopy(env)
    before = whole_state(env)
    agents = list(env.agents)
    call(env)
    assert whole_state(env) == before
    assert env.agents == agents
    if agents:
        seen = observed(env)
        seen_by_twin = observed(twin)
        assert plain(seen) == plain(seen_by_twin)
        assert play_on(env, seen, random.Random(1)) == play_on(twin, seen_by_twin, random.Random(1))
    if was_seeded(env):
        assert play(env, 2) == play(twin, 2)
    assert play(env, 3, seed=8) == play(twin, 3, seed=8)
    assert play(env, 4) == play(twin, 4)
    assert env.vector == twin.vector


def was_seeded(env: DroneSwarmSearch) -> bool:
    """Return whether the environment has a random stream to continue."""
    try:
        env.frame()
    except ResetNeeded:
        return False
    return True


def table(rows: list[tuple[Any, ...]]) -> list[Any]:
    """Return parameter sets with ids; a missing message is the repr of the value."""
    return [
        pytest.param(name, value, error, *(shown or [repr(value)]), id=f"{name}={value!r:.40}")
        for name, value, error, *shown in rows
    ]


@pytest.mark.parametrize(("name", "value", "error", "shown"), table(CONSTRUCTOR))
def test_constructor_rejects(name, value, error, shown):
    refused(lambda: DroneSwarmSearch(**{name: value}), error, name, " must ", "got", shown)


@pytest.mark.parametrize(("name", "value", "error", "shown"), table(RESET))
def test_reset_rejects(name, value, error, shown):
    def bad_reset(env: DroneSwarmSearch) -> None:
        calls = [] if name == PERSON else [{name: value}]
        if name not in ("seed", "options"):
            calls.append({"options": {name: value}})
        for arguments in calls:
            refused(lambda arguments=arguments: env.reset(**arguments), error, name, "got", shown)

    assert_untouched(in_mid_episode(), bad_reset)


@pytest.mark.parametrize("stage", STAGES)
def test_reset_changes_nothing_if_one_argument_is_bad(stage):
    """With one bad argument, the valid ones have no effect either."""

    def bad_reset(env: DroneSwarmSearch) -> None:
        options = {PERSON: [(0, 0), (9, 9)], DRONES: [(0, 0), (0, 1), (0, 2)]}
        refused(lambda: env.reset(1, vector=(1, 1), options=options), ValueError, PERSON, "(9, 9)")
        refused(lambda: env.reset(2, vector=(1, 1), drones_positions=[(0, 0)]), ValueError, DRONES)

    assert_untouched(stage(), bad_reset)


@pytest.mark.parametrize(
    ("actions", "error", "said"), STEP, ids=[f"{row[0]!r:.60}" for row in STEP]
)
def test_step_rejects(actions, error, said):
    def bad_step(env: DroneSwarmSearch) -> None:
        refused(lambda: env.step(actions), error, *said, "got")

    assert_untouched(in_mid_episode(), bad_step)


DRIFT = Drift((3, 3))
SAVED = next((Path(package.__file__).parent / "evaluation").rglob("*.npz"))  # tracks of the suite
TRACKS = Tracks(np.full((12, 2, 2), 3.0))

# Calls of other parts of the package: the call, the error, and parts of the message.
OTHERS: dict[str, tuple[Any, ...]] = {
    "policies.make(3)": (lambda: make(3, Scenario()), TypeError, "name must be one of", "got 3"),
    "an unknown policy": (lambda: make("greedy", Scenario()), ValueError, "did you mean greedy-"),
    "a scenario of a list": (lambda: Scenario.from_dict([]), TypeError, "mapping", "got []"),
    "a huge number": (lambda: DroneSwarmSearch(vector=(10**400, 0)), ValueError, "vector[0]"),
    "a larger one": (lambda: DroneSwarmSearch(vector=(10**5000, 0)), ValueError, "bits"),
    "a huge fraction": (
        lambda: Drift((0, 0), diffusion=Fraction(10**400)),
        ValueError,
        "diffusion",
    ),
    "a huge cell": (lambda: DroneSwarmSearch(**{PERSON: (10**400, 0)}), ValueError, PERSON),
    "a huge POD": (lambda: Person(DRIFT, 10**400), ValueError, POD),
    "fine of text": (lambda: Person(DRIFT, fine="abc"), TypeError, "fine must be an integer"),
    "classes of text": (lambda: Person(DRIFT, classes="abc"), TypeError, "classes must be an"),
    "fine without tracks": (lambda: Person(DRIFT, fine=3), ValueError, "belong to tracks"),
    "classes without tracks": (lambda: Person(DRIFT, classes=2), ValueError, "belong to tracks"),
    "too many classes": (lambda: Person(TRACKS, classes=10**400), ValueError, "classes", "1 to 2"),
    "finds_last": (lambda: SearchBatch(2, finds_last="no"), TypeError, "finds_last must be True"),
    "top_cells of text": (
        lambda: SwarmVectorEnv(2, top_cells="8"),
        TypeError,
        "top_cells must be an integer of at least 1, got '8'",
    ),
    "top_cells of flat": (
        lambda: SwarmVectorEnv(2, top_cells=9, observation="flat"),
        ValueError,
        "top_cells belongs to observation='top-cells', got 9",
    ),
    "progress": (
        lambda: evaluate("random", Scenario(), episodes=1, progress="bar"),
        TypeError,
        "progress must be True or False, got 'bar'",
    ),
    "an unknown parameter": (
        lambda: DroneVectorEnv(num_envs=64),
        TypeError,
        "DroneVectorEnv got an unexpected keyword argument 'num_envs'; did you mean num_swarms",
    ),
    "a sampler of NaN": (
        lambda: SearchBatch(2, sampler=lambda rng: {"vector": (NAN, 0)}).reset(),
        ValueError,
        "vector[0] must be a finite number, got nan",
    ),
    "a sampler of nothing": (
        lambda: SearchBatch(2, sampler=lambda rng: NAN).reset(),
        TypeError,
        "a search of sampler must be a mapping",
    ),
    "a scale for cells": (
        lambda: Tracks.read(SAVED, scale=Scale(100, 10)),
        ValueError,
        "scale, origin, cell, start, steps, diffusivity and seed belong to NetCDF",
    ),
}


@pytest.mark.filterwarnings("ignore:.*tracks are few")
@pytest.mark.parametrize(
    ("call", "error", "said"),
    [pytest.param(call, error, said, id=name) for name, (call, error, *said) in OTHERS.items()],
)
def test_other_calls_are_refused(call, error, said):
    refused(call, error, *said)


@pytest.mark.parametrize("make_one", [DroneSwarmSearch, lambda: SwarmVectorEnv(2)])
def test_a_mistyped_option_of_reset_suggests_the_nearest(make_one):
    with pytest.warns(UserWarning, match="ignored: 'drone_positions'; did you mean drones_posit"):
        make_one().reset(options={"drone_positions": [(1, 1)]})
    with pytest.warns(UserWarning, match=r"ignored: 'options'"):
        make_one().reset(options={"options": 1})  # as PettingZoo's test


@pytest.mark.parametrize("use", ["step", "render", "state", "frame"])
def test_use_before_reset(use):
    def too_early(env: DroneSwarmSearch) -> None:
        arguments = [GOOD] if use == "step" else []
        refused(lambda: getattr(env, use)(*arguments), ResetNeeded, "reset()")

    assert_untouched(make_env(), too_early)


@pytest.mark.parametrize("actions", [GOOD, None])
def test_step_after_the_end(actions):
    env = after_the_end()
    assert_untouched(
        env, lambda env: refused(lambda: env.step(actions), ResetNeeded, "reset()", "ended")
    )


@pytest.mark.parametrize("agent", ["drone3", 0])
@pytest.mark.parametrize("space", ["observation_space", "action_space"])
def test_spaces_of_unknown_agents(space, agent):
    refused(lambda: getattr(in_mid_episode(), space)(agent), KeyError, repr(agent))


@pytest.mark.parametrize("figure", ["step", "collision"])
@pytest.mark.parametrize(("value", "error"), [(True, TypeError), (1e308, ValueError)])
def test_reward_scheme_rejects(figure, value, error):
    refused(lambda: RewardScheme(**{figure: value}), error, f"RewardScheme.{figure}", repr(value))


@pytest.mark.parametrize("make", [list, np.array])
@pytest.mark.parametrize("as_option", [False, True])
def test_reset_accepts_every_form(make, as_option):
    cells = [(6, 6), (0, 3), (2, 2)]
    forms = {DRONES: make([make(cell) for cell in cells]), "vector": make([0.5, -1])}
    usual = play(make_env(), seed=3, drones_positions=cells, vector=(0.5, -1))
    arguments = {"options": forms} if as_option else forms
    assert play(make_env(), seed=np.int64(3), **arguments) == usual


@pytest.mark.parametrize("kind", [Action, np.int8, np.uint64, np.array], ids=str)
@pytest.mark.parametrize("n_drones", [1, 3])
def test_step_accepts_every_kind_of_integer(kind, n_drones):
    for action in Action:
        env = make_env(n_drones=n_drones)
        usual = make_env(n_drones=n_drones)
        for one in (env, usual):
            one.reset(seed=1, drones_positions=[(3, 3), (5, 2), (1, 5)][:n_drones])
        actions = dict.fromkeys(usual.agents, int(action))
        of_kind = {agent: kind(value) for agent, value in actions.items()}
        assert plain(env.step(of_kind)) == plain(usual.step(actions))


def forecast_of(grid_size):
    return ProbabilityMatrix(grid_size, Drift((0, 0)))


@pytest.fixture
def small_machine(monkeypatch):
    """A system that reports 64 MiB of memory."""
    monkeypatch.setattr(
        os, "sysconf", {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 2**14}.get, raising=False
    )


@pytest.mark.parametrize("grid_size", [10**6, 10**30])
@pytest.mark.parametrize("make", [DroneSwarmSearch, forecast_of])
def test_huge_grids_are_rejected(make, grid_size):
    refused(lambda: make(grid_size), ValueError, "grid_size", f"grid_size={grid_size}", "GiB")


@pytest.mark.parametrize(
    ("name", "make"),
    [
        ("grid_size", lambda: DroneSwarmSearch(3000)),
        ("grid_size", lambda: DroneSwarmSearch(1700, bayesian_update=True)),
        ("grid_size", lambda: forecast_of(4100)),
        ("n_drones", lambda: DroneSwarmSearch(1000, n_drones=10**6)),
        ("grid_size", lambda: action_masks([0], 2000)),
        ("grid_size", lambda: make("random", DroneSwarmSearch(2000).scenario)),
    ],
)
def test_errors_about_memory_name_the_parameter(small_machine, name, make):
    with pytest.raises(ValueError, match=rf"^(grid_size or )?{name}.* must be smaller: with .*GiB"):
        make()


@pytest.mark.parametrize("error", [AttributeError, ValueError, OSError])
def test_large_grids_are_accepted_if_the_memory_size_is_unknown(monkeypatch, error):
    """Windows has no sysconf, for example."""

    def silent(name):
        raise error(name)

    monkeypatch.setattr(os, "sysconf", silent, raising=False)
    DroneSwarmSearch(1000).reset(seed=1)
    refused(lambda: DroneSwarmSearch(2**32), ValueError, "grid_size", "GiB")


@pytest.mark.parametrize("ask", ["at", "joint", "marginals", "exact", "moves"])
@pytest.mark.parametrize(("step", "error"), [(2.0, TypeError), (True, TypeError), (-1, ValueError)])
def test_forecasts_reject_invalid_steps(ask, step, error):
    forecast = forecast_of(7)
    refused(
        lambda: getattr(forecast, ask)(step), error, "step must be an integer of at least 0", "got"
    )
    for same in (np.int64(3), np.uint8(3)):
        assert forecast.at(same).tolist() == forecast.at(3).tolist()
