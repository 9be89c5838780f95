"""Radios that end: what each drone knows, in engines, observations and policies: `radio_range`."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from sea import SEARCH, Enumeration, moves_apart, wreck
from twins import Twins, play

from DroneSwarmSearch import (
    Action,
    Drift,
    DroneSwarmSearch,
    Person,
    RewardScheme,
    Scenario,
    cli,
    policies,
)
from DroneSwarmSearch.core import Grid, NamedSearch
from DroneSwarmSearch.core.collision_avoidance import action_masks
from DroneSwarmSearch.evaluation import evaluate
from DroneSwarmSearch.evaluation.recording import frames_by_drone
from DroneSwarmSearch.evaluation.rollout import roll_out
from DroneSwarmSearch.layouts.view import View
from DroneSwarmSearch.rendering.painter import Painter
from DroneSwarmSearch.rendering.player import Player, Recording
from DroneSwarmSearch.vector import DroneVectorEnv, SwarmVectorEnv
from DroneSwarmSearch.wrappers import (
    ActionMask,
    CropsObservation,
    DictObservation,
    FlatObservation,
    OtherDrones,
    PlanesObservation,
    TopCellsObservation,
)

LEFT, RIGHT, UP, DOWN, _, IDLE = map(int, Action)


@pytest.mark.thorough
@pytest.mark.parametrize("persons", [2, 3])
@pytest.mark.parametrize("radio_range", [0, 1, 2])
def test_each_drone_knows_what_follows_from_what_it_hears(persons, radio_range):
    """Three drones on 4 x 4 cells beside one enumeration for each."""
    scenario = wreck(persons, n_drones=3, radio_range=radio_range, crash="block")
    env = DroneSwarmSearch(scenario=scenario)
    heard_finds = 0
    unheard_finds = 0
    for seed in range(8 if persons == 2 else 3):
        env.reset(seed=seed, drones_positions=[(0, 1), (1, 2), (2, 1)])
        exact = [Enumeration(scenario) for _ in range(3)]
        rng = np.random.default_rng(seed)
        for step in range(12):
            cells = env.snapshot().cells
            before = env.frame().found
            actions = rng.choice([0, 1, 2, 3, SEARCH, SEARCH, SEARCH], size=3)
            names = env.agents
            observations, _, _, _, _ = env.step(dict(zip(names, actions.tolist(), strict=True)))
            frame = env.frame()
            places = np.array(frame.drones)
            new = [who for who in range(persons) if frame.found[who] and not before[who]]
            for listener, own in enumerate(exact):
                distances = np.hypot(*(places - places[listener]).T)
                hears = [drone for drone in range(3) if distances[drone] <= radio_range]
                searched = [cells[drone] for drone in hears if actions[drone] == SEARCH]
                found = {who: frame.found_by[who] for who in new}
                told = {
                    who: frame.persons[who][1] * 4 + frame.persons[who][0]
                    for who, finder in found.items()
                    if finder in hears
                }
                heard_finds += sum(found[who] != listener for who in told)
                unheard_finds += len(found) - len(told)
                if searched:
                    own.search(searched, told)
                own.drift(step)
            if not env.agents:
                break
            for listener, own in enumerate(exact):
                matrix = observations[names[listener]]["observation"][1].reshape(-1)
                assert matrix == pytest.approx(own.matrix, abs=1e-6)
                for weights in env.frame(listener).hypotheses:
                    assert weights == pytest.approx(own.hypotheses, abs=1e-9)
    assert unheard_finds > 3
    assert (heard_finds > 0) == (radio_range > 0)


RULES = {
    "posterior": {"bayesian_update": True},
    "forecast": {},
    "expected": {"bayesian_update": True, "reward_scheme": RewardScheme.expected()},
    "expected, forecast": {"reward_scheme": RewardScheme.expected()},
    "coverage": {"bayesian_update": True, "mission": "coverage"},
}


@pytest.mark.thorough
@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("crash", ["end", "block", "pass"])
@pytest.mark.parametrize("changes", RULES.values(), ids=RULES)
def test_batches_are_the_same_bit_for_bit(changes, crash, shared):
    if shared:
        scenario = wreck(3, size=6, n_drones=3, **{"bayesian_update": False, **changes})
    else:
        person = Person(Drift((2, 2), vector=(0.2, 0.1), diffusion=0.2), 0.6)
        scenario = Scenario(6, n_drones=3, timestep_limit=30, persons=[person] * 2, **changes)
    scenario = scenario.replace(crash=crash, radio_range=1.5)
    twins = Twins(4, {"scenario": scenario, "drones_positions": [(1, 1), (3, 1), (2, 3)]})
    twins.reset(range(4))
    play(twins, 50)
    assert max(twins.episodes) > 0


def test_a_drone_without_radio_is_alone():
    """Until an unheard find, its matrix is that of a search with this drone alone, to the bit."""
    scenario = wreck(2, size=9, n_drones=3, radio_range=0)
    starts = [(1, 1), (4, 4), (7, 7)]
    env = DroneSwarmSearch(scenario=scenario)
    env.reset(seed=0, drones_positions=starts)
    alone = [DroneSwarmSearch(scenario=scenario.replace(n_drones=1)) for _ in starts]
    for other, start in zip(alone, starts, strict=True):
        other.reset(seed=0, drones_positions=[start])
    rng = np.random.default_rng(1)
    for _ in range(20):
        positions = np.array([env.frame().drones])
        actions = moves_apart(rng, positions, 9)[0].tolist()
        observations, *_ = env.step(dict(zip(env.agents, actions, strict=True)))
        for number, other in enumerate(alone):
            seen, *_ = other.step({"drone0": actions[number]})
            own = observations[f"drone{number}"]["observation"]
            assert own[0] == seen["drone0"]["observation"][0]
            assert own[1].tobytes() == seen["drone0"]["observation"][1].tobytes()
    assert env.frame().matrix.tobytes() != env.frame(0).matrix.tobytes()


def test_drones_that_always_hear_each_other_share_what_they_know():
    """A radio that reaches everywhere changes no observation."""
    far = wreck(3, size=6, n_drones=3, radio_range=20)
    envs = [
        DroneSwarmSearch(scenario=far),
        DroneSwarmSearch(scenario=far.replace(radio_range=None)),
    ]
    starts = [(0, 1), (2, 2), (5, 4)]
    for env in envs:
        env.reset(seed=3, drones_positions=starts)
    rng = np.random.default_rng(0)
    for _ in range(20):
        actions = moves_apart(rng, np.array([envs[0].frame().drones]), 6)[0].tolist()
        results = [env.step(dict(zip(env.agents, actions, strict=True))) for env in envs]
        if not envs[0].agents:
            break
        (own, *_), (shared, *_) = results
        for name in own:
            assert own[name]["observation"][1].tobytes() == shared[name]["observation"][1].tobytes()
            assert envs[0].frame(0).matrix.tobytes() == envs[0].frame().matrix.tobytes()
            assert envs[0].frame(0).hypotheses == envs[1].frame().hypotheses


@pytest.mark.parametrize("wrong", [-1, float("nan"), float("inf"), "far", True, [3]])
def test_a_range_that_is_no_distance_is_refused(wrong: Any):
    with pytest.raises((TypeError, ValueError), match="radio_range must be a finite number of at"):
        Scenario(radio_range=wrong)
    with pytest.raises((TypeError, ValueError), match="radio_range must be a finite number of at"):
        DroneSwarmSearch(radio_range=wrong)


def test_frames_of_drones_that_do_not_exist_are_refused():
    env = DroneSwarmSearch.example(radio_range=2)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="drone must be an integer from 0 to 2, got 3"):
        env.frame(3)


# Observations.

LAYOUTS = {
    "dict": DictObservation,
    "flat": FlatObservation,
    "planes": PlanesObservation,
    "top-cells": TopCellsObservation,
    "crops": CropsObservation,
}


def moved(scenario: Scenario, steps: int = 12) -> tuple[DroneSwarmSearch, list[dict[str, int]]]:
    """A search after some steps, and the actions that led there."""
    env = DroneSwarmSearch(scenario=scenario)
    env.reset(seed=5, drones_positions=[(0, 1), (1, 2), (5, 5)])
    rng = np.random.default_rng(0)
    made = []
    for _ in range(steps):
        actions = dict(zip(env.agents, rng.integers(0, 6, 3).tolist(), strict=True))
        env.step(actions)
        made.append(actions)
    return env, made


def far_apart() -> Scenario:
    still = Person(Drift((3, 3), vector=(0.1, 0), diffusion=0.2), 0.1)
    return Scenario(
        7, n_drones=3, timestep_limit=40, persons=[still] * 2, bayesian_update=True,
        crash="block", radio_range=2.5,
    )  # fmt: skip


@pytest.mark.parametrize("masks", [None, "observation"])
@pytest.mark.parametrize("name", LAYOUTS)
def test_wrappers_and_vector_environments_show_the_same(name, masks):
    scenario = far_apart()
    search, made = moved(scenario)
    env = LAYOUTS[name](search)
    if masks:
        env = ActionMask(env, in_observation=True, right_of_way=True)
    options = {"observation": name, "action_mask": masks, "right_of_way": True}
    start = [(0, 1), (1, 2), (5, 5)]
    drones = DroneVectorEnv(2, scenario=scenario, drones_positions=start, **options)
    swarms = SwarmVectorEnv(2, scenario=scenario, drones_positions=start, **options)
    env.reset(seed=5, drones_positions=start)
    drones.reset(seed=[5, 6])
    swarms.reset(seed=[5, 6])
    for actions in made:
        single = env.step(actions)[0]
        chosen = np.tile(list(actions.values()), 2)
        seen = drones.step(chosen)[0]
        joint = swarms.step(chosen.reshape(2, 3))[0]
    for drone, agent in enumerate(env.possible_agents):
        assert env.observation_space(agent).contains(single[agent])
        assert_same(single[agent], of_index(seen, drone))
    assert swarms.observation_space.contains(joint)
    if name == "dict":
        shown = joint["observation"] if masks else joint
        maps = [search.snapshot().matrices[drone] for drone in range(3)]
        assert shown["probability_matrix"][0].tobytes() == np.stack(maps).tobytes()


def of_index(seen: Any, index: int) -> Any:
    if isinstance(seen, dict):
        return {name: of_index(values, index) for name, values in seen.items()}
    return seen[index]


def assert_same(one: Any, other: Any) -> None:
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        for name in one:
            assert_same(one[name], other[name])
        return
    assert (one.dtype, one.tobytes()) == (other.dtype, other.tobytes())


def test_layouts_show_the_others_where_they_were_last_heard():
    env, _ = moved(far_apart())
    now = env.snapshot()
    others = OtherDrones(env)
    others.reset(seed=5, drones_positions=[(0, 1), (1, 2), (5, 5)])
    seen = others.step(dict.fromkeys(env.agents, IDLE))[0]
    now = env.snapshot()
    assert now.heard.tolist() == [[True, True, False], [True, True, False], [False, False, True]]
    lonely = seen["drone2"]
    assert others.observation_space("drone2").contains(lonely)
    assert lonely["other_drones"].tolist() == [[0, 1], [1, 2]]
    assert lonely["other_drones_age"].tolist() == [1, 1]
    assert seen["drone0"]["other_drones"].tolist() == [[1, 2], [5, 5]]
    assert seen["drone0"]["other_drones_age"].tolist() == [0, 1]

    env.step({"drone0": RIGHT, "drone1": RIGHT, "drone2": IDLE})
    age = np.float32(2 / 40)
    flat = FlatObservation(env)._observed({}, {})["drone2"]
    assert flat[:6].tolist() == (np.array([5, 5, 0, 1, 1, 2], np.float32) / np.float32(6)).tolist()
    assert flat[6:9].tolist() == [age, age, np.float32(38 / 40)]
    planes = PlanesObservation(env)._observed({}, {})["drone2"]
    wanted = np.zeros((7, 7), np.float32)
    wanted[1, 0] = wanted[2, 1] = 1 - age
    assert planes[2].tolist() == wanted.tolist()
    cells = TopCellsObservation(env, k=1)._observed({}, {})["drone2"]
    offsets = [5 / 6, 5 / 6, -4 / 6, -3 / 6, -5 / 6, -4 / 6]
    assert cells[3:].tolist() == pytest.approx([*offsets, age, age, 38 / 40])
    crops = CropsObservation(env)._observed({}, {})["drone2"]
    boxes = crops[:-2].reshape(4, 2, 25)[:, 1]
    assert boxes[0].sum() == 0
    assert boxes[1].sum() == pytest.approx(2 - 2 * age)


def test_masks_know_only_of_drones_in_range():
    cells = [0, 2, 1]
    hears_first = np.array([[True, False, True], [False, True, False], [True, False, True]])
    shared = action_masks(cells, 5)
    own = action_masks(cells, 5, heard=hears_first)
    assert not shared[0, RIGHT] and not own[0, RIGHT]  # drone 2 is in range
    assert not shared[1, LEFT] and own[1, LEFT]  # drone 1 hears nobody
    everybody = np.ones((3, 3), np.bool_)
    rng = np.random.default_rng(0)
    for right_of_way in (False, True):
        for _ in range(200):
            cells = rng.permutation(25)[:3]
            masks = action_masks(cells, 5, right_of_way)
            assert (masks == action_masks(cells, 5, right_of_way, heard=everybody)).all()


# Policies.


def wide(**changes: Any) -> Scenario:
    return wreck(2, size=9, n_drones=3, crash="block", timestep_limit=40, **changes)


STARTS = [(1, 1), (4, 4), (7, 7)]
OWN = ["greedy-matrix", "greedy-posterior", "greedy-forecast", "rollout", "imitation"]


@pytest.mark.parametrize("policy", OWN)
def test_without_radio_each_drone_acts_as_if_it_were_alone(policy):
    """As long as no drone finds or blocks anybody."""
    unfound = [replace(person, probability_of_detection=0.01) for person in wide().persons_to_find]
    scenario = wide(radio_range=0).replace(persons=unfound)
    env = DroneSwarmSearch(scenario=scenario)
    observations, _ = env.reset(seed=0, drones_positions=STARTS)
    swarm = policies.make(policy, scenario)
    alone = [policies.make(policy, scenario.replace(n_drones=1)) for _ in STARTS]
    met = False
    infos = {"Found": False}
    steps = 0
    while steps < 25 and not infos["Found"]:
        steps += 1
        actions = swarm(observations)
        for number, single in enumerate(alone):
            own = {"drone0": observations[f"drone{number}"]}
            assert met or single(own) == {"drone0": actions[f"drone{number}"]}
        before = env.snapshot().cells
        observations, _, _, _, infos = env.step(actions)
        after = env.snapshot().cells
        pairs = zip(before, actions.values(), strict=True)
        wanted = [Grid.of(9).neighbours[cell][action] for cell, action in pairs]
        met |= wanted != after
    assert steps > 4


@pytest.mark.parametrize("policy", OWN)
def test_drones_that_hear_all_act_as_without_radios(policy):
    far = wide(radio_range=30)
    envs = [DroneSwarmSearch(scenario=each) for each in (far, far.replace(radio_range=None))]
    for seed in range(3):
        seen = [env.reset(seed=seed, drones_positions=STARTS)[0] for env in envs]
        flown = [policies.make(policy, env.scenario) for env in envs]
        while envs[0].agents:
            actions = [each(own) for each, own in zip(flown, seen, strict=True)]
            assert actions[0] == actions[1]
            seen = [env.step(actions[0])[0] for env in envs]


@pytest.mark.thorough
@pytest.mark.parametrize("policy", [*OWN, "random", "parallel-sweep", "planner"])
def test_one_search_is_steered_as_in_a_batch(policy):
    scenario = wide(radio_range=2)
    results = [
        evaluate(policy, NamedSearch("wreck", "A test.", scenario, STARTS), episodes=6, view=view)
        for view in ("swarm", "parallel")
    ]
    assert results[0].success.value == results[1].success.value
    assert results[0].endings == results[1].endings


def test_yardsticks_refuse_what_single_drones_know():
    env = DroneSwarmSearch(scenario=wide(radio_range=2))
    observations, _ = env.reset(seed=0)
    with pytest.raises(ValueError, match="PlannerPolicy acts on what all drones know"):
        policies.make("planner", env.scenario)(observations)


@pytest.mark.thorough
def test_lessons_and_radio_find_more():
    """In a wreck that may have drifted in eight directions."""
    vectors = [(np.cos(angle), np.sin(angle)) for angle in np.arange(8) * np.pi / 4]
    drifts = [
        Drift((7, 7), vector=(0.3 * x, 0.3 * y), diffusion=0.03, adrift=15) for x, y in vectors
    ]
    together = Scenario(
        15, 3, persons=[Person(drifts, 0.9)] * 4, shared_drift=True, bayesian_update=True,
        crash="block", timestep_limit=40,
    )  # fmt: skip
    starts = [(6, 7), (7, 6), (8, 7)]

    def found(policy: str, scenario: Scenario) -> float:
        search = NamedSearch("wreck", "A test.", scenario, starts)
        episodes = roll_out(
            policies.make(policy, scenario), search, range(60), View("swarm"), wants_curves=False
        )
        return float((episodes.found_at > 0).mean())

    greedy = found("greedy-posterior", together)
    imitation = found("imitation", together)
    rollout = found("rollout", together)
    alone = found("rollout", together.replace(radio_range=0))
    assert min(imitation, rollout) > greedy + 0.03
    assert rollout > 1.2 * alone


# Pictures.


def test_pictures_show_one_drones_map_and_the_links():
    env = DroneSwarmSearch(scenario=far_apart(), render_mode="ansi", render_drone=2)
    env.reset(seed=5, drones_positions=[(0, 1), (1, 2), (5, 5)])
    for _ in range(3):
        env.step({"drone0": SEARCH, "drone1": SEARCH, "drone2": SEARCH})
    assert "what drone 2 knows | in range: 0-1" in " ".join(env.render().split())
    frames = frames_by_drone(env)
    assert [frame.viewer for frame in frames] == [0, 1, 2]
    frame = replace(env.frame(), by_drone=frames)
    assert frame.seen_by(2).matrix is frames[2].matrix
    assert frame.seen_by(None) is frame
    assert frame.links == ((0, 1),)
    painter = Painter(7)
    pictures = [painter.pixels(each) for each in (frame, *frames)]
    assert len({picture.tobytes() for picture in pictures}) == 4
    assert frames_by_drone(DroneSwarmSearch.example()) == ()


def test_a_key_shows_each_drones_map_in_turn():
    env = DroneSwarmSearch(scenario=far_apart())
    env.reset(seed=5, drones_positions=[(0, 1), (1, 2), (5, 5)])
    frame = replace(env.frame(), by_drone=frames_by_drone(env))
    player = Player(lambda seed: Recording(iter([frame])), seed=0, fps=6)
    shown = []
    for _ in range(5):
        shown.append(player.moment[0].viewer)
        player.press("m")
    assert shown == [None, 0, 1, 2, None]
    assert ("M", "map of each drone") in player.keys


@pytest.mark.parametrize("command", [["play", "--text"], ["record", "--out", "a.gif"]])
def test_a_drones_map_needs_radios(command, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name, *options = command
    with pytest.raises(SystemExit):
        cli.main([name, "classic", *options, "--drone", "1"])
    assert "--drone: in classic, all drones know the same" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
