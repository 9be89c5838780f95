"""The adapters for RLlib: environments, masked networks, the success rate."""

import importlib.util
from typing import Any
from unittest.mock import Mock, call

import numpy as np
import pytest
from helpers import TWO_DRONES, plain

from DroneSwarmSearch.adapters import TrainedPolicy
from DroneSwarmSearch.vector import DroneVectorEnv

if any(importlib.util.find_spec(name) is None for name in ("ray", "torch", "lz4")):
    pytest.skip("ray[rllib] is not installed", allow_module_level=True)  # the import is slow

pytestmark = pytest.mark.filterwarnings("default")  # from RLlib

LAYOUT = {"observation": "flat", "right_of_way": True, "reward_scale": 2.0**-17}
CONFIG = {**TWO_DRONES, "timestep_limit": 6, **LAYOUT}


@pytest.fixture(scope="module")
def rllib():
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # while RLlib is imported
        from DroneSwarmSearch.adapters import rllib
    return rllib


def test_the_batch_is_the_vector_environment(rllib):
    batch = rllib.DroneBatch({**CONFIG, "num_envs": 8})
    envs = DroneVectorEnv(4, action_mask="observation", **CONFIG)
    assert batch.num_envs == 8 and batch.single_observation_space == envs.single_observation_space
    rng = np.random.default_rng(0)
    shown, _ = batch.reset(seed=3)
    expected, _ = envs.reset(seed=3 * rllib.SEED_STRIDE)
    assert plain(shown) == plain(expected)
    for _ in range(20):
        actions = rng.integers(6, size=8)
        shown, rewards, terminated, truncated, infos = batch.step(actions)
        expected, *others, expected_infos = envs.step(actions)
        assert plain(shown) == plain(expected)
        results = (rewards, terminated, truncated)
        assert all((a == b).all() for a, b in zip(results, others, strict=True))
        assert (infos["is_success"] == expected_infos["is_success"]).all()


def test_env_runners_play_different_episodes(rllib):
    """RLlib seeds a runner's environments with numbers that the next runner uses, too."""
    persons = []
    for runner in (1, 2):
        batch = rllib.DroneBatch({**CONFIG, "timestep_limit": 12, "num_envs": 2 * 8})
        batch.reset(seed=runner)
        batch.step(np.full(16, 5))
        persons.append([batch.env.frame(swarm).persons for swarm in range(8)])
    assert persons[0][1:] != persons[1][:-1]  # equal if the seeds were consecutive


def test_what_the_batch_rejects(rllib):
    with pytest.raises(ValueError, match="gym_env_vectorize_mode"):
        rllib.DroneBatch(CONFIG)
    with pytest.raises(ValueError, match=r"num_envs must be a multiple of n_drones, 2, .* got 7"):
        rllib.DroneBatch({**CONFIG, "num_envs": 7})
    with pytest.raises(TypeError, match="unexpected keyword argument 'colour'"):
        rllib.DroneBatch({**CONFIG, "num_envs": 2, "colour": "red"})


def module_for(rllib: Any, batch: Any) -> Any:
    from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
    from ray.rllib.core.rl_module.rl_module import RLModuleSpec

    return RLModuleSpec(
        rllib.MaskedPPOModule,
        observation_space=batch.single_observation_space,
        action_space=batch.single_action_space,
        model_config=DefaultModelConfig(fcnet_hiddens=[16]),
    ).build()


def test_masked_actions_have_no_probability(rllib):
    import torch

    batch = rllib.DroneBatch({**CONFIG, "num_envs": 8})
    module = module_for(rllib, batch)
    observations, _ = batch.reset(seed=0)
    masks = torch.from_numpy(observations["action_mask"])
    assert not masks.all()
    given = {"obs": {key: torch.from_numpy(array) for key, array in observations.items()}}
    free = {"obs": {**given["obs"], "action_mask": torch.ones_like(masks)}}
    for forward in (module.forward_inference, module.forward_exploration, module.forward_train):
        logits = forward(given)["action_dist_inputs"]
        probabilities = logits.softmax(1)
        assert (probabilities[masks == 0] == 0).all() and (probabilities[masks == 1] > 0).all()
        unmasked = forward(free)["action_dist_inputs"]
        assert torch.equal(logits[masks == 1], unmasked[masks == 1])
    assert torch.equal(module.compute_values(given), module.compute_values(free))
    assert {*given["obs"]} == {"observation", "action_mask"}  # as it was


def test_the_module_needs_masks(rllib):
    batch = rllib.DroneBatch({**CONFIG, "num_envs": 2, "action_mask": None})
    with pytest.raises(ValueError, match="observation_space must have 'action_mask'"):
        module_for(rllib, batch)


def test_a_checkpoint_becomes_a_policy(rllib, tmp_path):
    batch = rllib.DroneBatch({**CONFIG, "num_envs": 400})
    module = module_for(rllib, batch)
    module.save_to_path(tmp_path / "learner_group" / "learner" / "rl_module" / "drone")
    observations, _ = batch.reset(seed=0)
    sampling = TrainedPolicy(rllib.logits(tmp_path, "drone"))
    actions = sampling(observations)
    allowed = observations["action_mask"] == 1
    assert actions.shape == (400,) and allowed[np.arange(400), actions].all()
    assert len({*actions.tolist()}) > 2
    sampling.reset(seed=0)
    assert (sampling(observations) == actions).all()
    best = TrainedPolicy(rllib.logits(tmp_path, "drone"), deterministic=True)
    assert (best(observations) == best(observations)).all()


def test_success_is_logged_for_drones_and_for_swarms(rllib):
    logger = Mock()
    for infos in (
        {"is_success": np.False_, "probability_of_success": np.float64(0.5)},
        {"drone0": {"is_success": True}, "drone1": {"is_success": True}},
    ):
        episode = Mock(get_infos={-1: infos}.get)
        rllib.log_success(episode=episode, metrics_logger=logger, env=None)
    assert logger.log_value.call_args_list == [
        call("success_rate", 0.0, reduce="mean"),
        call("probability_of_success", 0.5, reduce="mean"),
        call("success_rate", 1.0, reduce="mean"),
    ]
