"""The vector environments, compared with the single environment and with Gymnasium's own."""

import copy
import dataclasses
import inspect
import pickle
import re
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
import pytest
from crowded_searches import SEVERAL_PERSONS, SMALL
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.vector.utils import batch_space
from gymnasium.wrappers import vector as wrappers
from helpers import plain, without_history

from DroneSwarmSearch import Action, Drift, DroneSwarmSearch, Ending, Person, ResetNeeded, Scenario
from DroneSwarmSearch.vector import DroneVectorEnv, SearchBatch, SwarmVectorEnv
from DroneSwarmSearch.vector.vector_env import SearchVectorEnv
from DroneSwarmSearch.wrappers import action_masks

VIEWS = [SwarmVectorEnv, DroneVectorEnv]
MODES = list(AutoresetMode)
LAYOUTS = ("dict", "flat", "planes", "top-cells")

both_views = pytest.mark.parametrize("view", VIEWS)
all_modes = pytest.mark.parametrize("mode", MODES)
all_layouts = pytest.mark.parametrize("layout", LAYOUTS)

_CHANCES = [0.06, 0.09, 0.06, 0.09, 0.5, 0.2]  # moves are rare: they end most episodes


def random_actions(rng: np.random.Generator, env: VectorEnv) -> np.ndarray:
    """Actions of all sub-environments, in the form of the batched action space."""
    return rng.choice(len(Action), env.action_space.shape, p=_CHANCES)


def env_of(observations: Any, env_index: int) -> Any:
    """The observation of one sub-environment."""
    if isinstance(observations, Mapping):
        return with_arrays({key: array[env_index] for key, array in observations.items()})
    return observations[env_index]


def with_arrays(observation: Any) -> Any:
    """An observation with numbers as arrays without axes: a Box warns of anything else."""
    if isinstance(observation, Mapping):
        return {key: np.asarray(value) for key, value in observation.items()}
    return observation


def rollout(env: SearchVectorEnv, steps: int, policy_seed: int = 0) -> list[Any]:
    """All that some steps return, as plain data; ended ones are reset if autoreset is disabled."""
    rng = np.random.default_rng(policy_seed)
    log = []
    for _ in range(steps):
        result = env.step(random_actions(rng, env))
        log.append(as_data(result))
        dones = result[2] | result[3]
        if env.metadata["autoreset_mode"] is AutoresetMode.DISABLED and dones.any():
            log.append(as_data(env.reset(options={"reset_mask": dones})))
    return log


def as_data(result: tuple[Any, ...]) -> Any:
    """A result as plain data; arrays of objects as lists."""
    infos = dict(result[-1])
    if "final_obs" in infos:
        infos["final_obs"] = list(infos["final_obs"])
    return plain([*result[:-1], infos])


class Swarm(gymnasium.Env):
    """The single environment as a sub-environment of `SwarmVectorEnv`."""

    def __init__(self, separate_flags: bool = False, **parameters: Any) -> None:
        self.metadata = {}  # Gymnasium 1.1 writes the mode into it, which a class would keep
        self.env = DroneSwarmSearch(render_mode=None, **parameters)
        self.separate_flags = separate_flags
        n = self.env.n_drones
        size = self.env.grid_size
        self.action_space = spaces.MultiDiscrete([6] * n)
        self.observation_space = spaces.Dict(
            {
                "positions": spaces.Box(0, size - 1, (n, 2), np.int32),
                "probability_matrix": spaces.Box(0.0, 1.0, (size, size), np.float32),
            }
        )

    def reset(self, *, seed=None, options=None):
        observations, infos = self.env.reset(seed=seed, options=options)
        return self._seen(observations), self._infos_of(np.zeros(self.env.n_drones), infos)

    def step(self, action):
        names = self.env.agents
        observations, rewards, dones, _, infos = self.env.step(
            dict(zip(names, action.tolist(), strict=True))
        )
        ended = dones[names[0]]
        flags = ended, ended
        if self.separate_flags:
            truncated = self.env.frame().ending is Ending.TIME_LIMIT
            flags = ended and not truncated, truncated
        by_drone = np.array([rewards[name] for name in names])
        seen = self._seen(observations)
        own_infos = self._infos_of(by_drone, infos)
        return seen, by_drone.sum(), *flags, own_infos

    @staticmethod
    def _seen(observations: Mapping[str, Any]) -> dict[str, np.ndarray]:
        cells, matrices = zip(*[seen["observation"] for seen in observations.values()], strict=True)
        return {"positions": np.array(cells, np.int32), "probability_matrix": matrices[0]}

    def _infos_of(self, rewards: np.ndarray, infos: Mapping[str, Any]) -> dict[str, Any]:
        frame = self.env.frame()
        own = {
            "rewards": rewards,
            "Found": bool(infos["Found"]),
            "is_success": infos["is_success"],
            "persons_found": np.array(frame.found),
            "ending": frame.ending or 0,
            "step": frame.step,
        }
        if "probability_of_success" in infos:
            own["probability_of_success"] = infos["probability_of_success"]
        return own


def gymnasiums(num_envs, mode, separate_flags=False, **parameters):
    """Single environments in Gymnasium's own vector."""
    swarms = [lambda: Swarm(separate_flags, **parameters)] * num_envs
    return SyncVectorEnv(swarms, autoreset_mode=mode)


@both_views
@all_layouts
def test_everything_lies_in_its_space(view, layout):
    env = view(5, observation=layout, autoreset_mode="SameStep", **SMALL)
    n = env.num_envs
    per_swarm = env.num_envs // 5
    assert per_swarm == (1 if view is SwarmVectorEnv else SMALL["n_drones"])
    assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    actions = spaces.MultiDiscrete([6] * 3) if view is SwarmVectorEnv else spaces.Discrete(6)
    assert env.single_action_space == actions
    assert env.observation_space.sample() in env.observation_space
    assert env.observation_space == batch_space(env.single_observation_space, n)
    assert env.action_space == batch_space(env.single_action_space, n)
    env.action_space.seed(1)

    def check(observations: Any) -> None:
        assert observations in env.observation_space
        for env_index in range(n):
            assert env_of(observations, env_index) in env.single_observation_space

    observations, infos = env.reset(seed=3)
    check(observations)
    ended = 0
    for _ in range(12):
        observations, rewards, terminated, truncated, infos = env.step(env.action_space.sample())
        check(observations)
        assert (rewards.dtype, rewards.shape) == (np.float64, (n,))
        for flags in (terminated, truncated):
            assert (flags.dtype, flags.shape) == (np.bool_, (n,))
        for key in [key for key in infos if not key.startswith("_")]:
            assert (infos[f"_{key}"].dtype, infos[f"_{key}"].shape) == (np.bool_, (n,))
        ended += int(terminated.sum())
        for last in infos["final_obs"][terminated] if terminated.any() else ():
            assert with_arrays(last) in env.single_observation_space
    assert ended > n


def masks_of(env: SearchVectorEnv) -> np.ndarray:
    """The masks of the current state, in the form of observations and infos."""
    masks = action_masks(env.batch.cells, SMALL["grid_size"], env.right_of_way)
    drones = () if env.single_action_space.shape == () else (SMALL["n_drones"],)
    return masks.astype(np.int8).reshape(env.num_envs, *drones, len(Action))


@both_views
@pytest.mark.parametrize(
    ("layout", "mode", "right_of_way"),
    [
        ("dict", AutoresetMode.NEXT_STEP, True),
        ("planes", AutoresetMode.SAME_STEP, False),
        ("flat", AutoresetMode.DISABLED, True),
    ],
)
def test_observations_or_infos_hold_masks_on_request(view, layout, mode, right_of_way):
    how = {"observation": layout, "autoreset_mode": mode, **SMALL}
    env = view(4, action_mask="observation", right_of_way=right_of_way, **how)
    plainly = view(4, action_mask="info", right_of_way=right_of_way, **how)
    assert env.observation_space == batch_space(env.single_observation_space, env.num_envs)

    def check(shown: Any, observations: Any, infos: dict[str, Any]) -> None:
        assert shown in env.observation_space
        assert plain(shown["observation"]) == plain(observations)
        assert plain(shown["action_mask"]) == plain(masks_of(env)) == plain(infos["action_mask"])
        assert plain(env.action_masks()) == plain(plainly.action_masks(right_of_way))

    check(env.reset(seed=3)[0], *plainly.reset(seed=3))
    rng = np.random.default_rng(0)
    ended = 0
    for _ in range(20):
        actions = random_actions(rng, env)
        shown, *results, infos = env.step(actions.copy())
        observations, *others, their_infos = plainly.step(actions.copy())
        check(shown, observations, their_infos)
        assert plain(results) == plain(others)
        assert their_infos.keys() - infos.keys() == {"action_mask", "_action_mask"}
        assert their_infos["_action_mask"].all()
        dones = results[1]
        for index in np.flatnonzero(their_infos.get("_final_obs", [])):
            last = infos["final_obs"][index]
            assert plain(last["observation"]) == plain(their_infos["final_obs"][index])
            assert last["action_mask"] in env.single_observation_space["action_mask"]
        if mode is AutoresetMode.DISABLED and dones.any():
            options = {"reset_mask": dones}
            observations, their_infos = plainly.reset(options=options)
            check(env.reset(options=options)[0], observations, their_infos)
            assert their_infos["_action_mask"].tolist() == dones.tolist()
        ended += int(dones.sum())
    assert ended > 5


@pytest.mark.parametrize("seed", [7, np.int64(7), (7, 8, 9), np.array([7, 8, 9])], ids=type)
def test_swarms_are_seeded_one_by_one(seed):
    env = DroneVectorEnv(3, **SMALL)
    batch = SearchBatch(3, **SMALL)
    env.reset(seed=seed)
    batch.reset([7, 8, 9])
    for _ in range(3):
        idle = np.full((3, 3), Action.IDLE)
        env.step(idle.reshape(-1))
        batch.step(idle)
        assert plain(env.batch.person_cells) == plain(batch.person_cells)


def test_drones_may_be_given_a_seed_each():
    """With a seed for each sub-environment, a swarm takes its first drone's."""
    by_env, by_swarm = (DroneVectorEnv(2, n_drones=3, grid_size=5) for _ in range(2))
    by_env.reset(seed=np.array([7, 1, 2, 9, 3, 4]))
    by_swarm.reset(seed=[7, 9])
    assert by_env.np_random_seed == by_swarm.np_random_seed == 7
    assert plain(rollout(by_env, 20)) == plain(rollout(by_swarm, 20))
    mask = np.repeat([False, True], 3)
    by_env.reset(seed=[None] * 3 + [8] * 3, options={"reset_mask": mask})
    by_swarm.reset(seed=[None, 8], options={"reset_mask": mask})
    assert plain(rollout(by_env, 20)) == plain(rollout(by_swarm, 20))


@pytest.mark.parametrize(
    ("seed", "error", "words"),
    [
        (-1, ValueError, r"seed must be an integer of at least 0, got -1"),
        ("a", TypeError, r"seed must be an integer of at least 0, got 'a'"),
        ([1, 2], ValueError, "seed must hold 3 integers, one per swarm, got 2"),
        ([1, 2.0, 3], TypeError, r"seed\[1\] must be an integer of at least 0, got 2.0"),
    ],
)
def test_wrong_seeds_are_refused(seed, error, words):
    env = DroneVectorEnv(3, **SMALL)
    env.reset(seed=1)
    before = pickle.dumps(env.batch)
    with pytest.raises(error, match=words):
        env.reset(seed=seed)
    assert pickle.dumps(env.batch) == before


def by_drone(observations: dict[str, np.ndarray], n: int) -> dict[str, np.ndarray]:
    """Observations of swarms as those of their drones."""
    return {
        "position": observations["positions"].reshape(-1, 2),
        "probability_matrix": observations["probability_matrix"].repeat(n, axis=0),
    }


def check_infos(infos: dict[str, Any], wanted: dict[str, Any], n: int) -> None:
    """Compare infos, each where its mask says that it is meant.

    Args:
        infos: of a view.
        wanted: of the swarms.
        n: the sub-environments in each swarm.
    """
    keys = [key for key in wanted if not key.startswith("_") and key != "final_obs"]
    for key in keys:
        if key == "rewards" and key not in infos:
            continue  # a drone has its own as its reward
        meant = wanted[f"_{key}"].repeat(n)
        assert plain(infos[f"_{key}"]) == plain(meant), key
        if key == "final_info":
            check_infos(infos[key], wanted[key], n)
        else:
            assert np.array_equal(infos[key][meant], wanted[key].repeat(n, axis=0)[meant]), key


@pytest.mark.thorough
@both_views
@all_modes
@pytest.mark.parametrize(
    ("case", "separate"),
    [(SMALL, False), (SEVERAL_PERSONS, True)],
    ids=["small", "several persons, separate flags"],
)
def test_episodes_end_and_begin_as_in_gymnasiums_vector(view, mode, case, separate):
    swarms = 3
    n_drones = case["n_drones"]
    env = view(swarms, autoreset_mode=mode, separate_flags=separate, **case)
    reference = gymnasiums(swarms, mode, separate, **case)
    n = env.num_envs // swarms
    rng = np.random.default_rng(23)
    met = set()

    def seen(observations: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        return observations if view is SwarmVectorEnv else by_drone(observations, n_drones)

    observations, infos = env.reset(seed=20)
    wanted, wanted_infos = reference.reset(seed=20)
    check_infos(infos, wanted_infos, n)
    for _ in range(60):
        assert plain(observations) == plain(seen(wanted))
        actions = random_actions(rng, reference)
        observations, rewards, terminated, truncated, infos = env.step(
            actions.reshape(env.action_space.shape)
        )
        wanted, their_rewards, *their_flags, wanted_infos = reference.step(actions)
        dones = their_flags[0] | their_flags[1]
        # Gymnasium's infos are by now those of the next episode where one has begun in the
        # same step; the rewards and the ending that the step brought are in the final infos.
        if "final_info" in wanted_infos:
            for key in ("rewards", "ending", "is_success"):
                wanted_infos[key][dones] = wanted_infos["final_info"][key][dones]
        check_infos(infos, wanted_infos, n)
        if view is SwarmVectorEnv:
            assert plain(rewards) == plain(their_rewards)
        else:
            assert plain(rewards) == plain(wanted_infos["rewards"].reshape(-1))
        assert plain(terminated) == plain(their_flags[0].repeat(n))
        assert plain(truncated) == plain(their_flags[1].repeat(n))
        met |= set(infos["ending"].tolist())
        assert ("final_obs" in infos) == (mode is AutoresetMode.SAME_STEP and dones.any())
        if "final_obs" in infos:
            assert plain(infos["_final_obs"]) == plain(dones.repeat(n))
            for env_index, last in enumerate(infos["final_obs"]):
                theirs = wanted_infos["final_obs"][env_index // n]
                if theirs is not None and view is DroneVectorEnv:
                    one_swarm = {key: value[None] for key, value in theirs.items()}
                    theirs = env_of(by_drone(one_swarm, n_drones), env_index % n)
                assert plain(last) == plain(theirs)
        if mode is AutoresetMode.DISABLED and dones.any():
            observations, infos = env.reset(options={"reset_mask": dones.repeat(n)})
            wanted, wanted_infos = reference.reset(options={"reset_mask": dones})
            check_infos(infos, wanted_infos, n)
    possible = {Ending.FOUND, Ending.LEFT_GRID, Ending.TIME_LIMIT, 0}
    possible |= {Ending.COLLISION} if n_drones > 1 else set()
    assert set(met) == possible


@both_views
def test_without_autoreset_ended_swarms_must_be_reset(view):
    env = view(3, autoreset_mode="Disabled", grid_size=3, timestep_limit=4)
    with pytest.raises(ResetNeeded, match=r"call reset\(\) first"):
        env.step(np.full(env.action_space.shape, Action.IDLE))
    env.reset(seed=0)
    actions = np.array([Action.LEFT, Action.IDLE, Action.UP]).reshape(env.action_space.shape)
    dones = env.step(actions)[2]
    before = pickle.dumps(env.batch)
    with pytest.raises(ResetNeeded, match=r"searches \[0, 2\] have ended.*'reset_mask'"):
        env.step(actions)
    assert pickle.dumps(env.batch) == before
    env.reset(options={"reset_mask": np.array([True, False, False])})
    _, infos = env.reset(options={"reset_mask": np.array([False, False, True])})
    assert infos["step"].tolist() == [0, 1, 0]
    assert infos["_step"].tolist() == [False, False, True]
    assert dones.tolist() == [True, False, True]
    env.step(np.full(env.action_space.shape, Action.IDLE))
    assert env.batch.steps.tolist() == [1, 2, 1]


@both_views
def test_wrong_masks_are_refused(view):
    env = view(2, grid_size=3, n_drones=2)
    env.reset(seed=0)
    n = env.num_envs
    before = pickle.dumps(env.batch)
    for mask in (np.ones(n, np.int64), np.ones(n + 1, np.bool_)):
        with pytest.raises(ValueError, match=rf"'reset_mask'\] must be .* shape \({n},\), got"):
            env.reset(options={"reset_mask": mask})
    if view is DroneVectorEnv:
        with pytest.raises(ValueError, match="equal for all drones of a swarm"):
            env.reset(options={"reset_mask": np.array([True, True, False, True])})
    assert pickle.dumps(env.batch) == before


@both_views
def test_the_options_of_a_reset_hold_as_long_as_they_should(view):
    """A catalogue stays, the rest is for one episode."""
    persons = [Person(Drift((x, 2), diffusion=0.1)) for x in range(3)]
    sizes = {"grid_size": 4, "n_drones": 3}
    env = view(20, autoreset_mode="Disabled", situations=persons[:1], **sizes)
    positions = [[3, 3], [0, 1], [2, 2]]
    given = {"situations": persons, "situation": 2, "drones_positions": positions}
    env.reset(seed=9, options=given)
    assert set(env.batch.situation.tolist()) == {2}
    assert env.batch.positions.tolist() == [positions] * 20
    env.reset()
    assert set(env.batch.situation.tolist()) == {0, 1, 2}
    assert env.batch.positions[:, 2].tolist() == [[2, 0]] * 20


@both_views
def test_the_conventions_of_vector_environments_are_kept(view):
    env = view(3, autoreset_mode="SameStep", **SMALL)
    assert repr(env) == f"{view.__name__}(num_envs={env.num_envs})"
    assert wrappers.RecordEpisodeStatistics(env).unwrapped is env.unwrapped is env
    assert view.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP  # the class has the usual one
    assert env.metadata["render_modes"] == ["ansi", "rgb_array"]
    env.close()
    env.close()
    assert env.closed


def arrays_in(result: Any) -> list[np.ndarray]:
    """All arrays in a result."""
    if isinstance(result, np.ndarray):
        return [result]
    if isinstance(result, Mapping):
        result = result.values()
    return [array for part in result for array in arrays_in(part)]


@both_views
@all_layouts
def test_without_copies_the_same_arrays_come_back(view, layout):
    parameters = {"observation": layout, **SMALL}
    env = view(3, copy=False, **parameters)
    copies = view(3, **parameters)
    assert as_data(env.reset(seed=1)) == as_data(copies.reset(seed=1))
    assert rollout(env, 15) == rollout(copies, 15)
    begun = arrays_in(env.reset()[0])
    after = arrays_in(env.step(np.full(env.action_space.shape, Action.IDLE))[0])
    assert len(begun) == (2 if layout == "dict" else 1)
    assert all(mine is again for mine, again in zip(begun, after, strict=True))


def test_a_shared_reward_is_the_mean_over_the_swarm():
    own = DroneVectorEnv(4, grid_size=5, n_drones=3, reward_scale=0.5)
    shared = DroneVectorEnv(4, grid_size=5, n_drones=3, reward_scale=0.5, shared_reward=True)
    for env in (own, shared):
        env.reset(seed=0)
    actions = np.tile([Action.SEARCH, Action.IDLE, Action.IDLE], 4)
    rewards, means = (env.step(actions)[1].reshape(4, 3) for env in (own, shared))
    assert (rewards[:, 0] != rewards[:, 1]).all()
    assert (means == rewards.mean(axis=1, keepdims=True)).all()
    with pytest.raises(TypeError, match="shared_reward must be True or False, got 1"):
        DroneVectorEnv(4, shared_reward=1)


@pytest.mark.parametrize("mode", ["ansi", "rgb_array"])
@both_views
def test_every_swarm_is_drawn_as_in_the_single_environment(view, mode):
    """Once for each sub-environment, as Gymnasium's wrappers for videos and windows expect."""
    env = view(3, render_mode=mode, **SEVERAL_PERSONS)
    each = env.num_envs // 3
    singles = [DroneSwarmSearch(render_mode=mode, **SEVERAL_PERSONS) for _ in range(3)]
    env.reset(seed=3)
    for seed, single in enumerate(singles, 3):
        single.reset(seed=seed)
    for action in (Action.SEARCH, Action.IDLE):
        expected = [picture for single in singles for picture in [single.render()] * each]
        assert plain(env.render()) == plain(tuple(expected))
        for swarm, single in enumerate(singles):
            assert plain(vars(env.frame(swarm))) == without_history(single.frame())
            single.step(dict.fromkeys(single.agents, action))
        env.step(np.full(env.action_space.shape, action))


@both_views
@all_modes
def test_what_was_returned_never_changes(view, mode):
    env = view(3, autoreset_mode=mode, **SMALL)
    rng = np.random.default_rng(0)
    results: list[Any] = [env.reset(seed=1)]
    as_it_was = [as_data(results[0])]
    for _ in range(14):
        results.append(env.step(random_actions(rng, env)))
        as_it_was.append(as_data(results[-1]))
        if mode is AutoresetMode.DISABLED and (dones := results[-1][2]).any():
            results.append(env.reset(options={"reset_mask": dones}))
            as_it_was.append(as_data(results[-1]))
    assert [as_data(result) for result in results] == as_it_was


@both_views
@pytest.mark.parametrize("copies", [False, True])
def test_a_copy_goes_on_identically(view, copies):
    env = view(3, observation="flat", autoreset_mode="SameStep", copy=copies, **SEVERAL_PERSONS)
    env.reset(seed=2)
    rollout(env, 4)
    others = copy.deepcopy(env), pickle.loads(pickle.dumps(env))
    mine = rollout(env, 20)
    assert [rollout(other, 20) for other in others] == [mine, mine]


@both_views
def test_unknown_options_are_warned_about(view):
    env = view(2)
    with pytest.warns(
        UserWarning, match=r"options may hold reset_mask, .*ignored: 'speed'"
    ) as all_:
        env.reset(seed=0, options={"speed": 3})
    assert [warning.filename for warning in all_] == [__file__]


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"observation": "pixels"}, ValueError, "observation must be one of 'dict', 'flat', 'plan"),
        ({"autoreset_mode": "Never"}, ValueError, "'Never' is not a valid AutoresetMode"),
        ({"action_mask": "infos"}, ValueError, "action_mask must be one of None, 'observation', "),
        ({"reward_scale": 0}, ValueError, "reward_scale must be a finite number above 0, got 0"),
        ({"render_mode": "human"}, ValueError, "render_mode must be one of None, 'ansi', 'rgb_ar"),
        ({"grid_size": 1}, ValueError, "grid_size must be an integer of at least 2"),
    ],
)
def test_wrong_arguments_are_refused(arguments, error, words):
    with pytest.raises(error, match=words):
        SwarmVectorEnv(**arguments)


@pytest.mark.parametrize(
    ("view", "count", "other"),
    [(SwarmVectorEnv, "num_envs", "num_swarms"), (DroneVectorEnv, "num_swarms", "num_envs")],
)
def test_each_view_has_a_name_for_the_number_of_swarms(view, count, other):
    env = view(**{count: 4}, n_drones=3)
    assert env.batch.num_rows == 4
    assert env.num_envs == (4 if view is SwarmVectorEnv else 12) == env.action_space.shape[0]
    for wrong in (0, 2.0):
        with pytest.raises((TypeError, ValueError), match=f"^{count} must be an integer of at lea"):
            view(**{count: wrong})
    unexpected = f"^{view.__name__} got an unexpected keyword argument '{other}'; did you mean"
    with pytest.raises(TypeError, match=f"{unexpected}.*{count}"):
        view(**{other: 4})
    with pytest.raises(TypeError, match=r"'gird_size'; did you mean grid_size\?"):
        view(4, gird_size=9)


@both_views
def test_the_signature_shows_every_keyword(view):
    shown = inspect.signature(view).parameters
    own = "observation top_cells action_mask right_of_way autoreset_mode "
    assert list(shown)[1:] == [
        *["shared_reward"] * (view is DroneVectorEnv),
        *f"{own}separate_flags reward_scale copy render_mode".split(),
        "scenario",
        "situations",
        "situation",
        "drones_positions",
        "sampler",
        *(field.name for field in dataclasses.fields(Scenario)),
    ]
    usual = {name: shown[name].default for name in list(shown)[1:]}
    for field in dataclasses.fields(Scenario):
        assert usual[field.name] == field.default
    env = view(2, **usual)
    plainly = view(2)
    assert plain(env.reset(seed=1)) == plain(plainly.reset(seed=1))
    assert all(re.search(rf"\b{name}\b", SwarmVectorEnv.__doc__) for name in list(shown)[2:])


@both_views
@all_modes
def test_actions_stay_the_callers(view, mode):
    """Steps and resets neither write to them nor look at them later."""
    env = view(2, autoreset_mode=mode, grid_size=3, n_drones=2, person_initial_position=(2, 2))
    env.reset(seed=0)
    leave = np.full(env.action_space.shape, Action.UP)
    leave.flags.writeable = False
    assert env.step(leave)[2].all()
    env.reset()
    search = np.full(env.action_space.shape, Action.SEARCH)
    env.step(search)
    search[...] = Action.IDLE
    assert env.frame(0).searching == (True, True)
