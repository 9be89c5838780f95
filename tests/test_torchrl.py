"""The searches in TorchRL: `SearchEnv`, and the environments in TorchRL's wrappers."""

import warnings
from functools import partial
from typing import Any, ClassVar

import numpy as np
import pytest

from DroneSwarmSearch import Action, Ending, Scenario
from DroneSwarmSearch.evaluation import View, evaluate
from DroneSwarmSearch.training import TRAINING_TASK
from DroneSwarmSearch.vector import DroneVectorEnv, SwarmVectorEnv

pytest.importorskip("torchrl")

import torch

with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)
    from torchrl.collectors import Collector
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModule, TensorDictModuleBase
from torch import nn
from torchrl.envs import (
    ActionMask,
    Compose,
    EnvBase,
    GymEnv,
    GymWrapper,
    InitTracker,
    RewardSum,
    TransformedEnv,
    check_env_specs,
)
from torchrl.envs.utils import RandomPolicy

from DroneSwarmSearch.adapters import TrainedPolicy
from DroneSwarmSearch.adapters.torchrl import (
    ACTION,
    ACTION_MASK,
    ACTION_VALUE,
    GROUP,
    LOGITS,
    OBSERVATION,
    PPO_KEYS,
    RETURN,
    REWARD,
    STATE,
    SUCCESS,
    SearchEnv,
    episode_metrics,
    logits,
    masked_policy,
)

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::UserWarning")

IDLE = int(Action.IDLE)
SEARCH = int(Action.SEARCH)

SMALL = {**TRAINING_TASK, "timestep_limit": 8}
"""Short episodes, so that a few steps pass through several of them."""


def valid_actions(masks: Any, rng: np.random.Generator) -> Any:
    """A random valid action for each mask, (..., 6)."""
    masks = np.asarray(masks)
    return np.where(masks, rng.random(masks.shape), -1.0).argmax(axis=-1)


def act(env: EnvBase, shown: TensorDictBase, actions: Any) -> TensorDictBase:
    """Make a step with given actions; returns the next tensordict."""
    return env.step(shown.set(ACTION, torch.as_tensor(actions)))["next"]


def reset_swarms(env: EnvBase, shown: TensorDictBase, mask: Any) -> TensorDictBase:
    """Reset some swarms; returns the current tensordict of all."""
    mask = torch.as_tensor(mask).reshape(-1, 1)
    return env.reset(shown.exclude("reward").set("_reset", mask)).exclude("_reset")


@pytest.mark.parametrize("layout", ["flat", "dict", "planes", "top-cells", "crops"])
def test_specs_describe_the_data(layout):
    """Also without a posterior, with several persons, with one drone, in the coverage mission."""
    for state, parameters in (
        (False, TRAINING_TASK),
        (True, {"grid_size": 6, "n_drones": 1, "person_initial_position": [(2, 2), (3, 3)]}),
        (True, {"grid_size": 6, "mission": "coverage", "n_drones": 3}),
    ):
        env = SearchEnv(3, observation=layout, state=state, **parameters)
        check_env_specs(env, seed=1)
        drones = len(env.group_map["drones"])
        assert env.observation_spec[ACTION_MASK].shape == (3, drones, 6)
        keys = env.observation_spec.keys(True, True)
        assert (STATE in keys) == state
        assert (("info", "probability_of_success") in keys) == (drones != 1)


def same(tensors: Any, arrays: Any) -> None:
    """Check that tensors equal arrays, bit for bit; also those in nested dicts."""
    if isinstance(arrays, dict):
        for name, array in arrays.items():
            same(tensors[name], array)
    else:
        assert tensors.numpy().tobytes() == arrays.tobytes()


@pytest.mark.parametrize(("separate_flags", "right_of_way"), [(False, True), (True, False)])
def test_it_shows_what_the_vector_environment_shows(separate_flags, right_of_way):
    """Observations, masks, rewards, flags, infos and states of several episodes."""
    options = {"right_of_way": right_of_way, "separate_flags": separate_flags, **TRAINING_TASK}
    env = SearchEnv(5, state=True, reward_scale=2.0**-17, **options)
    how = {"observation": "flat", "action_mask": "observation", "autoreset_mode": "Disabled"}
    bare = DroneVectorEnv(5, reward_scale=2.0**-17, **how, **options)
    env.set_seed(7)
    shown = env.reset()
    seen, infos = bare.reset(seed=7)
    rng = np.random.default_rng(0)
    endings = set()
    for _ in range(3 * TRAINING_TASK["timestep_limit"]):
        same(shown[OBSERVATION], seen["observation"])
        same(shown[ACTION_MASK].to(torch.int8), seen["action_mask"])
        same(shown[STATE], bare.batch.state_planes())
        for name in ("Found", "probability_of_success", "is_success", "ending"):
            same(shown["info", name], infos[name][::2])
        actions = valid_actions(shown[ACTION_MASK], rng)
        shown = act(env, shown, actions)
        seen, rewards, terminated, truncated, infos = bare.step(actions.reshape(-1))
        same(shown[REWARD], rewards.astype(np.float32))
        ended = terminated | truncated
        flags = {"terminated": terminated, "truncated": truncated, "done": ended}
        for name, values in flags.items():
            same(shown["drones", name], values)
            same(shown[name], values[::2])
        if ended.any():
            endings |= {*infos["ending"].tolist()}
            same(shown[STATE], bare.batch.state_planes())
            seen, infos = bare.reset(options={"reset_mask": ended})
        shown = reset_swarms(env, shown, shown["done"])  # of some swarms, or none
    assert Ending.TIME_LIMIT in endings and Ending.LEFT_GRID not in endings


def persons_after(env: SearchEnv, steps: int = 12) -> torch.Tensor:
    """Where the persons are in every step of the next episodes of idle drones."""
    shown = env.reset()
    states = []
    for _ in range(steps):
        shown = act(env, shown, torch.full((env.batch_size[0], 2), IDLE))
        states.append(shown[STATE][:, 2])
    return torch.stack(states, dim=1)


def test_seeds_determine_the_episodes():
    make = partial(SearchEnv, 3, state=True, **TRAINING_TASK)
    first = make(seed=5)
    played = persons_after(first)
    assert not torch.equal(played[0], played[1])  # swarm i has the seed 5 + i
    later = persons_after(first)
    assert not torch.equal(later, played)  # without a new seed, the sequence continues

    other = make()
    other.set_seed(5)
    assert torch.equal(persons_after(other), played)
    assert torch.equal(persons_after(other), later)
    other.set_seed(6)
    assert torch.equal(persons_after(other)[0], played[1])

    # A swarm that is not reset keeps its seed until it is.
    shown = other.reset()
    other.set_seed(5)
    reset_swarms(other, shown, [True, False, True])
    assert torch.equal(persons_after(other)[1], played[1])


def test_data_stay_as_they_were_collected():
    """No array is reused: a rollout equals copies that were made at each step."""
    env = SearchEnv(4, state=True, **SMALL)
    env.set_seed(0)
    played = TransformedEnv(env, ActionMask(ACTION, ACTION_MASK)).rollout(
        30, break_when_any_done=False
    )
    env.set_seed(0)
    shown = env.reset()
    for step in range(30):
        now = played[:, step]
        for key in (OBSERVATION, ACTION_MASK, STATE, SUCCESS):
            assert torch.equal(shown[key], now[key])
        kept = act(env, shown, now[ACTION]).clone()
        for key in (OBSERVATION, REWARD, STATE, SUCCESS, "done", ("drones", "terminated")):
            assert torch.equal(kept[key], now["next"][key])
        shown = reset_swarms(env, kept, kept["done"]) if kept["done"].any() else kept
    assert int(played["next", "done"].sum()) >= 4 * 3


def test_transforms_and_collectors_take_it():
    env = TransformedEnv(SearchEnv(4, **SMALL), Compose(InitTracker(), RewardSum()))
    check_env_specs(env)
    policy = RandomPolicy(env.full_action_spec)
    collector = Collector(env, policy, frames_per_batch=4 * 20, total_frames=4 * 40)
    for batch in collector:
        assert batch.shape == (4, 20)
        returns = batch["next"][RETURN]
        rewards = batch["next"][REWARD]
        expected = torch.zeros(4, 2, 1)
        for step in range(20):
            begins = batch["is_init"][:, step]
            sums = batch[RETURN][:, step]
            assert (sums[begins.squeeze(-1)] == 0).all()
            expected = sums + rewards[:, step]
            assert torch.allclose(returns[:, step], expected)
        ended = batch["next", "done"].squeeze(-1)
        metrics = episode_metrics(batch)
        assert metrics["reward"] == pytest.approx(float(returns[ended].mean()))
        assert metrics["found"] == float(batch["next"][SUCCESS][ended].double().mean())
    collector.shutdown()
    assert episode_metrics(env.rollout(1)[:, :0]) == {}


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"observation": "pixels"}, ValueError, "observation must be one of"),
        ({"state": "yes"}, TypeError, "state must be"),
        ({"seed": -1}, ValueError, "seed must be"),
    ],
)
def test_bad_arguments(arguments, error, message):
    with pytest.raises(error, match=message):
        SearchEnv(**arguments)


def constant_logits(*logits: float) -> TensorDictModule:
    """A network with the same logits for every observation."""

    def network(observations: torch.Tensor) -> torch.Tensor:
        return torch.tensor(logits).expand(*observations.shape[:-1], 6)

    return TensorDictModule(network, [OBSERVATION], [LOGITS])


def test_masked_policies_sample_valid_actions():
    env = SearchEnv(64, **TRAINING_TASK)
    policy = masked_policy(constant_logits(50.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    acted = policy(env.reset())
    masks = acted[ACTION_MASK]
    actions = acted[ACTION]
    assert masks.gather(-1, actions.unsqueeze(-1)).all()
    # The drones start at the left edge, where LEFT is masked: the other actions are equal.
    probabilities = 1.0 / masks[:, 0].sum(dim=-1)
    logprobs = acted[PPO_KEYS["sample_log_prob"]][:, 0]
    assert torch.allclose(logprobs.exp(), probabilities)


def test_trained_policies_act_on_what_evaluate_shows():
    """They keep to the masks, leave PyTorch's generator alone, and take the likeliest action."""
    shown = {
        "observation": np.zeros((4, 105), np.float32),
        "action_mask": np.array([[0, 1, 0, 1, 1, 1]] * 4, np.int8),
    }
    policy = masked_policy(constant_logits(9.0, 1.0, 9.0, 1.0, 1.0, 1.0))
    sampled = TrainedPolicy(logits(policy, n_drones=2))
    state = torch.get_rng_state()
    draws = [sampled(shown).tolist() for _ in range(100)]
    assert torch.equal(torch.get_rng_state(), state)
    assert {action for drawn in draws for action in drawn} == {1, 3, 4, 5}
    likeliest = masked_policy(constant_logits(9.0, 0.0, 9.0, 2.0, 1.0, 0.0))
    assert TrainedPolicy(logits(likeliest, 2), deterministic=True)(shown).tolist() == [3] * 4


class Recorder(nn.Module):
    """Allows every action, and records what is observed."""

    seen: ClassVar[list[tuple[torch.Tensor, ...]]] = []

    def forward(self, *observations: torch.Tensor) -> torch.Tensor:
        self.seen.append(tuple(each.clone() for each in observations))
        return torch.zeros(*observations[0].shape[:2], 6)


@pytest.mark.parametrize("layout", ["flat", "dict"])
def test_trained_policies_are_evaluated_as_they_were_trained(layout):
    """The evaluation shows what `SearchEnv` shows, and masks as it does."""
    keys = [OBSERVATION]
    if layout == "dict":
        keys = [(*OBSERVATION, "position"), (*OBSERVATION, "probability_matrix")]
    policy = masked_policy(TensorDictModule(Recorder(), keys, [LOGITS]))
    env = SearchEnv(3, observation=layout, right_of_way=True, seed=2, **SMALL)
    Recorder.seen.clear()
    policy(env.reset())
    view = View("drone", layout, action_mask=True, right_of_way=True)
    trained = TrainedPolicy(logits(policy, n_drones=2))
    results = [evaluate(trained, Scenario(**SMALL), episodes=3, seed=2, view=view) for _ in (0, 1)]
    for shown, evaluated in zip(*Recorder.seen[:2], strict=True):
        assert torch.equal(shown, evaluated)
    assert results[0].endings[Ending.COLLISION] == results[0].endings[Ending.LEFT_GRID] == 0
    assert results[0].success == results[1].success


class Counting(TensorDictModuleBase):
    """A policy that counts its steps in a hidden state, and takes the action of that number."""

    in_keys: ClassVar = [OBSERVATION, (GROUP, "count"), "is_init"]
    out_keys: ClassVar = [ACTION_VALUE, ("next", GROUP, "count")]

    def forward(self, batch: TensorDictBase) -> TensorDictBase:
        begins = batch["is_init"][:, None]
        count = torch.where(begins, torch.zeros_like(batch[GROUP, "count"]), batch[GROUP, "count"])
        batch[ACTION_VALUE] = nn.functional.one_hot(count[..., 0].long(), 6).float()
        batch["next", GROUP, "count"] = count + 1
        return batch


def test_recurrent_policies_carry_their_hidden_states():
    view = View("drone", "flat", action_mask=True)
    trained = TrainedPolicy(logits(Counting(), 2, {"count": (1,)}), deterministic=True, view=view)
    assert trained.remembers
    shown = {"observation": np.zeros((4, 3), np.float32), "action_mask": np.ones((4, 6), np.int8)}
    for _ in range(2):
        trained.reset(seed=0)
        assert [trained(shown).tolist() for _ in range(4)] == [[step] * 4 for step in range(4)]
    assert not TrainedPolicy(logits(Counting(), 2)).remembers


def test_gym_env_makes_the_id():
    """TorchRL first passes a keyword that the environment does not have."""
    env = GymEnv("DroneSwarmSearch-v0", observation="flat", **{**SMALL, "n_drones": 1})
    check_env_specs(env)


@pytest.mark.parametrize("kind", [DroneVectorEnv, SwarmVectorEnv])
@pytest.mark.parametrize(
    ("mode", "masks", "layout"),
    [
        ("Disabled", "observation", "flat"),
        ("Disabled", "info", "dict"),
        ("SameStep", "info", "flat"),
    ],
)
def test_gym_wrapper(kind, mode, masks, layout):
    """It shows what the vector environment shows, masks included."""
    options = {"observation": layout, "right_of_way": True, "separate_flags": True, **SMALL}

    def wrap() -> Any:
        env = kind(4, action_mask=masks, autoreset_mode=mode, **options)
        wrapped = GymWrapper(env, categorical_action_encoding=True)
        registers = (mode, masks) == ("Disabled", "info")
        return wrapped.auto_register_info_dict() if registers else wrapped

    check_env_specs(wrap())
    wrapped = wrap()
    bare = kind(4, action_mask="observation", autoreset_mode="Disabled", **options)
    rng = np.random.default_rng(1)
    ended = np.zeros(bare.num_envs, bool)
    shown = wrapped.reset(seed=3)
    _ = bare.reset(seed=3)
    while not ended.any():  # the same searches as without TorchRL
        actions = valid_actions(shown["action_mask"], rng)
        stepped, shown = wrapped.step_and_maybe_reset(shown.set("action", torch.tensor(actions)))
        observations, rewards, terminated, truncated, _ = bare.step(actions)
        after = stepped["next"]
        ended = terminated | truncated
        same(after["action_mask"], observations["action_mask"])
        assert after["reward"].flatten().tolist() == np.float32(rewards).tolist()
        assert after["truncated"].flatten().tolist() == truncated.tolist()
