"""Evaluations: episodes, observations, results, stored entries and files."""

import csv
import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from helpers import data_of, made_evaluation

from DroneSwarmSearch import (
    Action,
    Drift,
    DroneSwarmSearch,
    Ending,
    Person,
    RewardScheme,
    Scenario,
    evaluation,
)
from DroneSwarmSearch.evaluation import (
    NamedSearch,
    View,
    compare,
    evaluate,
    roll_out,
    run,
    save_csv,
)
from DroneSwarmSearch.layouts import LAYOUTS
from DroneSwarmSearch.policies import DEFAULT_WEIGHTS as DEFAULT_WEIGHTS_PATH
from DroneSwarmSearch.vector import DroneVectorEnv, SwarmVectorEnv

DEFAULT_WEIGHTS = str(DEFAULT_WEIGHTS_PATH)


def named(**changes: Any) -> NamedSearch:
    """A small search with finds, misses, collisions and drones that leave the grid."""
    drones = changes.pop("drones", ((1, 1), (4, 5), (5, 0)))
    scenario = Scenario(
        **{
            "grid_size": 6,
            "n_drones": len(drones),
            "vector": (0.1, -0.1),
            "person_initial_position": [(2, 2), (3, 4)],
            "disperse_constant": 2,
            "timestep_limit": 12,
            "probability_of_detection": (0.9, 0.6),
            "bayesian_update": False,
            "reward_scheme": RewardScheme(),
            **changes,
        }
    )
    return NamedSearch("small", "For tests.", scenario, drones)


MASKED = View(action_mask=True)
FLAT = View(observation="flat")
ALONE = {"drones": ((0, 0),), "person_initial_position": (2, 2), "probability_of_detection": 0.8}


def steer(x: int, y: int, matrix: Any) -> int:
    """Climb to the likeliest cell nearby and search there; drones may collide."""
    ways = {Action.SEARCH: (x, y), Action.RIGHT: (x + 1, y), Action.DOWN: (x, y + 1)}
    ways |= {Action.LEFT: (x - 1, y), Action.UP: (x, y - 1)}
    inside = {action: cell for action, cell in ways.items() if {*cell} <= {*range(len(matrix))}}
    return max(inside, key=lambda action: matrix[inside[action][::-1]])


def in_swarms(shown: Any) -> Any:
    every = zip(shown["positions"].tolist(), shown["probability_matrix"], strict=True)
    return np.array([[steer(x, y, matrix) for x, y in cells] for cells, matrix in every])


def in_drones(shown: Any) -> Any:
    every = zip(shown["position"].tolist(), shown["probability_matrix"], strict=True)
    return np.array([steer(x, y, matrix) for (x, y), matrix in every])


def in_parallel(shown: Any) -> dict[str, int]:
    seen = {name: each["observation"] for name, each in shown.items()}
    return {name: int(steer(*cell, matrix)) for name, (cell, matrix) in seen.items()}


def alone(policy: Callable[[Any], dict[str, int]], each: NamedSearch, seed: int) -> dict[str, Any]:
    """What an evaluation records, played in a single environment."""
    env = DroneSwarmSearch(scenario=each.scenario)
    observations, _ = env.reset(seed=seed, drones_positions=each.drones)
    found_at = [0] * len(each.scenario.persons_to_find)
    total = 0.0
    steps = 0
    while env.agents:
        observations, rewards, *_ = env.step(policy(observations))
        steps += 1
        total += rewards["total_reward"]
        for person, found in enumerate(env.frame().found):
            if found and not found_at[person]:
                found_at[person] = steps
    ending = env.frame().ending
    return {"found_at": found_at, "ending": ending, "steps": steps, "return": total}


def uncertain(**changes: Any) -> NamedSearch:
    """A search of one drone for two persons with several hypotheses."""
    persons = [
        Person([Drift((1, 1), vector=(0.2, 0.1), vector_sd=0.05), Drift((2, 0), diffusion=0.2)]),
        Person(Drift((1, 2), start_sd=0.7, diffusion=0.1), probability_of_detection=0.8),
    ]
    each = named(**ALONE)
    return dataclasses.replace(each, scenario=each.scenario.replace(persons=persons, **changes))


@pytest.mark.parametrize(
    "each",
    [
        named(),
        named(bayesian_update=True, drones=((2, 0), (3, 5))),
        named(**ALONE),
        named(**ALONE, bayesian_update=True),
        uncertain(),
        uncertain(bayesian_update=True),
    ],
)
def test_episodes_are_those_of_the_single_environment(each):
    """Episode i equals the environment's with seed + i, in every portion."""
    got = evaluate(in_swarms, each, episodes=40, seed=7, progress=False).episodes
    seen = set()
    for i in range(40):
        single = alone(in_parallel, each, 7 + i)
        assert got.found_at[i].tolist() == single["found_at"]
        assert got.endings[i] == single["ending"]
        assert got.steps[i] == single["steps"]
        assert got.returns[i] == pytest.approx(single["return"], rel=1e-15)
        seen.add(single["ending"])
    assert len(seen) > 1


@pytest.mark.parametrize("bayesian_update", [False, True])
def test_every_view_plays_the_same_episodes(bayesian_update):
    played = []
    for policy, form in ((in_swarms, "swarm"), (in_drones, "drone"), (in_parallel, "parallel")):
        view = View(form, bayesian_update=bayesian_update)
        result = evaluate(policy, named(), episodes=30, view=view, progress=False)
        assert result.search.scenario.bayesian_update is bayesian_update
        played.append(data_of(result))
    assert played[0] == played[1] == played[2]


def arrays_in(shown: Any, name: str = "") -> dict[str, np.ndarray]:
    """The arrays of nested observations."""
    if not isinstance(shown, dict):
        return {name: shown}
    parts = [arrays_in(part, f"{name}/{key}") for key, part in shown.items()]
    return {key: array for part in parts for key, array in part.items()}


@pytest.mark.thorough
@pytest.mark.parametrize("masks", [None, False, True])
@pytest.mark.parametrize("observation", LAYOUTS)
@pytest.mark.parametrize("kind", [SwarmVectorEnv, DroneVectorEnv])
def test_policies_see_the_observations_of_the_vector_environments(kind, observation, masks):
    """All arrays, with the rows of the episodes that have not ended."""
    each = named(bayesian_update=True)
    n = 8
    how = {} if masks is None else {"action_mask": "observation", "right_of_way": masks}
    env = kind(n, observation=observation, autoreset_mode="Disabled", **how, **each.parameters)
    expected, _ = env.reset(seed=list(range(n)))
    rng = np.random.default_rng(1)
    per_swarm = env.num_envs // n
    under_way = np.arange(n)
    over_early = 0

    def policy(shown: Any) -> Any:
        nonlocal expected, under_way, over_early
        indices = (under_way[:, None] * per_swarm + np.arange(per_swarm)).reshape(-1)
        seen = arrays_in(shown)
        wanted = arrays_in(expected)
        rows = [seen.pop(key) for key in [*seen] if key.endswith("/row")]
        assert len(rows) == (kind is SwarmVectorEnv and observation == "dict")
        assert all(row.tolist() == under_way.tolist() for row in rows)
        assert {*seen} == {*wanted}
        for key, array in seen.items():
            assert array.dtype == wanted[key].dtype
            np.testing.assert_array_equal(array, wanted[key][indices])
        actions = rng.choice([1, 3, 4, 5], size=(n, 3), p=[0.03, 0.03, 0.54, 0.4])
        mine = actions[under_way]
        over = np.setdiff1d(np.arange(n), under_way)
        actions[over] = int(Action.IDLE)
        if over.size:
            over_early += 1
            mask = np.isin(np.arange(n), over).repeat(per_swarm)
            env.reset(options={"reset_mask": mask})
        expected, _, ended, _, _ = env.step(actions.reshape(env.action_space.shape))
        under_way = under_way[~ended.reshape(n, -1)[under_way, 0]]
        return mine if kind is SwarmVectorEnv else mine.reshape(-1)

    view = "swarm" if kind is SwarmVectorEnv else "drone"
    shown = View(view, observation, masks is not None, bool(masks))
    roll_out(policy, each, range(n), shown, wants_curves=False)
    assert over_early


def test_a_policy_is_prepared_once_and_copied_for_every_portion(monkeypatch, tmp_path):
    monkeypatch.setattr(run, "PORTION", 4)
    log = tmp_path / "log"

    class Listener:
        calls = 0

        def tell(self, *words: Any) -> None:
            with log.open("a") as file:
                print(*words, file=file)

        def prepare(self, drones: Any) -> None:
            self.tell("prepare", drones)

        def reset(self, seed: Any = None, rows: Any = None) -> None:
            self.tell("reset", seed, rows, "after", self.calls)

        def __call__(self, shown: Any) -> Any:
            self.calls += 1
            idle = int(Action.IDLE)
            if "drone0" in shown:
                return dict.fromkeys(shown, idle)
            return np.full((len(shown["row"]), 3), idle)

    evaluate(Listener(), named(), episodes=6, seed=10, progress=False)
    prepared, *portions = log.read_text().splitlines()
    assert prepared == "prepare ((1, 1), (4, 5), (5, 0))"
    assert portions == ["reset [10, 11, 12, 13] None after 0", "reset [14, 15] None after 0"]
    evaluate(Listener(), named(), episodes=2, seed=10, view="parallel", progress=False)
    assert log.read_text().splitlines()[4:] == ["reset 10 None after 0", "reset 11 None after 12"]


@pytest.mark.thorough
@pytest.mark.parametrize("policy", [in_swarms, "random", "greedy-posterior", "planner"])
def test_the_size_of_portions_has_no_effect(policy, monkeypatch):
    """Nor do the caches of the package's policies."""
    whole = data_of(evaluate(policy, named(), episodes=10, progress=False))
    monkeypatch.setattr(run, "PORTION", 4)
    parts = data_of(evaluate(policy, named(), episodes=10, progress=False))
    assert parts == whole


WHOLE = (
    r"the policy's actions must be integers from 0 to 5 of shape \({}\), one for each drone.*, got"
)


@pytest.mark.parametrize(
    ("returned", "view", "error", "message"),
    [
        ([[1, 2, 3]], "swarm", ValueError, rf"{WHOLE.format('2, 3')} shape \(1, 3\)"),
        (np.ones((2, 3)), "swarm", TypeError, f"{WHOLE.format('2, 3')} float64"),
        ({"drone0": 1}, "swarm", TypeError, "must be an array of integers with view=.swarm"),
        (np.arange(2, 8), "drone", ValueError, f"{WHOLE.format('6,')} 6"),
        (np.ones(6, int), "parallel", TypeError, "the policy's actions must be a mapping from"),
    ],
)
def test_actions_are_validated(returned, view, error, message):
    with pytest.raises(error, match=message):
        evaluate(lambda shown: returned, named(), episodes=2, view=view, progress=False)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"episodes": 0}, ValueError, "episodes must be an integer of at least 1, got 0"),
        ({"seed": -1}, ValueError, "seed must be an integer of at least 0, got -1"),
        ({"view": 3}, TypeError, "view must be one of 'swarm', 'drone', 'parallel', got 3"),
        (
            {"policy": "planner", "view": MASKED},
            ValueError,
            "view must be .* without masks, for planner",
        ),
        ({"policy": 4}, TypeError, "policy must be a policy's name or a callable .*, got 4"),
        (
            {"policy": "planner", "view": FLAT},
            ValueError,
            "view must be .* with observation='dict'",
        ),
        ({"policy": "imitation", "view": "drone"}, ValueError, "view must be 'swarm' or"),
    ],
)
def test_bad_arguments_are_refused(changes, error, message):
    arguments = {"policy": in_swarms, "search": named(), "episodes": 2, "progress": False}
    with pytest.raises(error, match=message):
        evaluate(**{**arguments, **changes})


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"observation": "x"}, ValueError, "observation must be one of 'dict', 'flat', 'planes'"),
        ({"form": "parallel", "observation": "flat"}, ValueError, "needs observation='dict'"),
        ({"right_of_way": True}, ValueError, "right_of_way needs action_mask, which is False"),
    ],
)
def test_a_view_is_validated(arguments, error, message):
    with pytest.raises(error, match=message):
        View(**arguments)


def made(found_at: Any, limit: int = 10, **changes: Any) -> evaluation.Evaluation:
    """An evaluation of made-up episodes."""
    return made_evaluation(found_at, named(timestep_limit=limit), **changes)


def test_an_episode_succeeds_when_the_last_person_is_found():
    got = made([[2, 7], [3, 0], [0, 0], [10, 1]])
    assert got.times.tolist() == [7, 10, 10, 10]
    assert got.time.value == pytest.approx(9.25)
    assert got.success.value == 0.5
    assert ": 4 episodes, 50.0% success (" in repr(got)
    assert got.success_by_time.tolist() == [0] * 7 + [0.25] * 3 + [0.5]
    counts = {Ending.FOUND: 2, Ending.TIME_LIMIT: 2}
    assert got.endings == {ending: counts.get(ending, 0) for ending in Ending}


def test_a_posterior_is_calibrated_and_a_prior_is_not():
    """One cell is searched repeatedly; the posterior's error is that of Poisson counts."""
    each = named(
        person_initial_position=(2, 2),
        probability_of_detection=1,
        drones=((3, 2),),
        disperse_constant=1,
        timestep_limit=30,
    )

    def stay(shown: Any) -> Any:
        return np.full(shown["positions"].shape[:2], int(Action.SEARCH))

    prior, posterior = (
        evaluate(stay, each, episodes=600, view=view, progress=False).reliability
        for view in (View(bayesian_update=False), View(bayesian_update=True))
    )
    assert (posterior.searches >= 100).sum() >= 3
    off = np.abs(posterior.found - posterior.forecast) / np.sqrt(posterior.forecast + 1)
    assert off.max() < 4
    assert prior.forecast.sum() > 1.2 * prior.found.sum()
    assert prior.expected_error > 5 * posterior.expected_error


def test_comparisons_are_paired():
    """The interval of the difference is that of the differences, not of two samples."""
    rng = np.random.default_rng(0)
    times = rng.integers(1, 80, (400, 1)).repeat(2, axis=1)
    slow = made(times + 5, limit=100)
    fast = made(times, limit=100, policy="fast")
    got = compare(fast, slow)
    assert got.time.value == -5.0
    assert -6.0 < got.time.low < got.time.high < -4.0
    assert got.success.value == 0.0
    assert got.success.high == -got.success.low == pytest.approx(0.0095, abs=5e-5)
    assert got.policies == ("fast", "mine")
    some = made(np.where(np.arange(400)[:, None] % 4, times, 0), limit=100)
    won = compare(fast, some).success
    assert won.value == 0.25
    assert 0.2 < won.low < 0.25 < won.high < 0.3


def test_only_the_same_episodes_can_be_compared():
    times = np.ones((4, 2), int)
    with pytest.raises(ValueError, match="second must be of the same search as first"):
        compare(made(times), made(times, limit=11))
    with pytest.raises(ValueError, match="4 from seed 0, got 3 from seed 0"):
        compare(made(times), made(times[:3]))


OWN = (
    "import numpy as np\n\ndef act(shown):\n    return np.full(shown['positions'].shape[:2], {})\n"
)


@pytest.mark.parametrize("search", [named(), named(**ALONE)])
def test_workers_have_no_effect(search, tmp_path, monkeypatch):
    monkeypatch.setattr(run, "PORTION", 4)
    (tmp_path / "mine.py").write_text(OWN.format(4), "utf-8")
    for policy in ("random", "greedy-posterior", in_swarms, f"{tmp_path}/mine.py:act"):
        one, two = (evaluate(policy, search, episodes=10, workers=each) for each in (1, 2))
        assert two.summary == one.summary
        assert data_of(two) == data_of(one)


def test_csv_has_a_row_for_each_evaluation(tmp_path):
    got, bounded = (made([[2, 7], [3, 0]], seed=5, bound=bound) for bound in (None, 0.5))
    save_csv(tmp_path / "summary.csv", [got, bounded])
    plain, bounded = csv.DictReader((tmp_path / "summary.csv").read_text("utf-8").splitlines())
    assert (plain["policy"], plain["search"], plain["mission"]) == ("mine", "small", "rescue")
    assert (plain["episodes"], plain["seed"], plain["mean_return"]) == ("2", "5", "0.0")
    assert float(plain["success"]) == 0.5
    assert float(plain["success_low"]) == got.success.low
    assert float(plain["restricted_mean_time_high"]) == got.time.high
    assert (plain["found"], plain["time_limit"], plain["collision"]) == ("1", "1", "0")
    assert (plain["share_of_bound"], plain["bound"]) == ("", "")
    assert float(bounded["share_of_bound"]) == 1.0
    assert made([[1, 1]], bound=0.0).share_of_bound is None
