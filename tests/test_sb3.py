"""The adapter for Stable-Baselines3, with Stable-Baselines3 itself."""

import csv
import itertools
from pathlib import Path
from typing import Any, ClassVar

import gymnasium
import numpy as np
import pytest
from helpers import data_of, plain

from DroneSwarmSearch import Action, Ending, Scenario
from DroneSwarmSearch.evaluation import View, evaluate
from DroneSwarmSearch.vector import DroneVectorEnv, SwarmVectorEnv
from DroneSwarmSearch.vector.vector_env import SearchVectorEnv

pytest.importorskip("stable_baselines3")

from stable_baselines3 import DQN, PPO
from stable_baselines3.common.callbacks import BaseCallback, EvalCallback
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.logger import configure
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecMonitor

from DroneSwarmSearch.adapters import TrainedPolicy
from DroneSwarmSearch.adapters.sb3 import LogSuccess, SB3Policy, SB3VecEnv, logits

both_views = pytest.mark.parametrize("view", [SwarmVectorEnv, DroneVectorEnv])

SMALL: dict[str, Any] = {
    "grid_size": 4,
    "n_drones": 2,
    "vector": (0.3, -0.2),
    "person_initial_position": (2, 1),
    "timestep_limit": 7,
}


def made(view: type[SearchVectorEnv], num_envs: int = 3, **arguments: Any) -> SB3VecEnv:
    """A view of small searches in Stable-Baselines3's form."""
    return SB3VecEnv(view(num_envs, autoreset_mode="SameStep", **{**SMALL, **arguments}))


def random_actions(rng: np.random.Generator, env: SB3VecEnv) -> np.ndarray:
    """Actions for all sub-environments; moves are rare, since they end most episodes."""
    shape = (env.num_envs, *env.action_space.shape)
    return rng.choice(len(Action), shape, p=[0.04, 0.11, 0.04, 0.11, 0.4, 0.3])


@both_views
@pytest.mark.parametrize("layout", ["flat", "dict"])
def test_ppo_learns(view, layout):
    env = VecMonitor(made(view, 8, observation=layout))
    policy = "MultiInputPolicy" if layout == "dict" else "MlpPolicy"
    model = PPO(policy, env, n_steps=16, batch_size=32, n_epochs=1, seed=1, device="cpu")
    before = [parameter.detach().clone() for parameter in model.policy.parameters()]
    model.learn(16 * env.num_envs)
    after = list(model.policy.parameters())
    assert any((old != new).any() for old, new in zip(before, after, strict=True))
    assert len(model.ep_info_buffer) > 0
    actions, _ = model.predict(env.reset(), deterministic=True)
    assert actions.shape == (env.num_envs, *env.action_space.shape)


@both_views
@pytest.mark.parametrize("separate", [False, True])
@pytest.mark.parametrize("layout", ["flat", "dict", "planes", "top-cells"])
def test_steps_are_the_views(view, separate, layout):
    """Observations, rewards and ends; an end's last observation and whether time was up."""
    options = {"observation": layout, "separate_flags": separate}
    options["bayesian_update"] = knows = layout == "flat"
    env = made(view, **options)
    plainly = view(3, autoreset_mode="SameStep", **options, **SMALL)
    env.seed(5)
    assert plain(env.reset()) == plain(plainly.reset(seed=5)[0])
    logged = ["is_success", "probability_of_success"][: 1 + knows]
    assert env.reset_infos == [{**dict.fromkeys(logged, 0.0), "is_success": False}] * env.num_envs
    rng = np.random.default_rng(0)
    time_ups = 0
    ended = 0
    chances = 0
    for _ in range(80):
        actions = random_actions(rng, env)
        seen, rewards, dones, infos = env.step(actions.copy())
        theirs, their_rewards, terminated, truncated, their_infos = plainly.step(actions.copy())
        assert plain(seen) == plain(theirs)
        assert plain(rewards) == plain(their_rewards.astype(np.float32))
        assert plain(dones) == plain(terminated | truncated)
        for index, info in enumerate(infos):
            known = their_infos["final_info"] if dones[index] else their_infos
            assert [info.pop(name) for name in logged] == [known[name][index] for name in logged]
            if not dones[index]:
                assert info == {}
                continue
            ended += 1
            chances += int(knows and known["probability_of_success"][index] > 0.0)
            assert sorted(info) == ["TimeLimit.truncated", "terminal_observation"]
            assert plain(info["terminal_observation"]) == plain(their_infos["final_obs"][index])
            time_limit_reached = truncated[index] and not terminated[index]
            assert info["TimeLimit.truncated"] is bool(time_limit_reached)
            time_ups += int(time_limit_reached)
    assert ended > 10 and (chances > 5) == knows
    assert (time_ups > 0) == separate


def test_a_seed_and_options_hold_for_one_reset():
    env = made(SwarmVectorEnv)
    paths = []
    for seed in (7, None, 7):
        if seed is not None:
            env.seed(seed)
        env.reset()
        paths.append([])
        for _ in range(5):
            env.step(np.full((env.num_envs, *env.action_space.shape), Action.IDLE))
            paths[-1].append(env.env.batch.person_cells.tolist())
    assert paths[0] == paths[2] != paths[1]
    env.set_options({"drones_positions": [(3, 3), (0, 2)]})
    for cells in ([[3, 3], [0, 2]], [[0, 0], [1, 0]]):
        env.reset()
        assert env.env.batch.positions.tolist() == [cells] * 3


def test_attributes_and_methods_are_the_views():
    env = made(DroneVectorEnv)
    n = env.num_envs
    env.reset()
    assert env.get_attr("render_mode") == [None] * n
    assert env.get_attr("batch", indices=[0, 2]) == [env.env.batch] * 2
    env.set_attr("note", "here")
    assert env.env.note == "here"  # type: ignore[attr-defined]
    assert [frame.step for frame in env.env_method("frame", 1, indices=[0])] == [0]
    assert env.env_is_wrapped(Monitor, indices=[0]) == [False]
    with pytest.raises(AttributeError, match="nothing"):
        env.get_attr("nothing")
    env.close()
    assert env.env.closed


@both_views
def test_every_sub_environment_has_its_own_mask(view):
    apart = {**SMALL, "drones_positions": [(0, 0), (2, 0)]}  # both might go between
    env = SB3VecEnv(view(3, autoreset_mode="SameStep", right_of_way=True, **apart))
    env.reset()
    masks = env.env.action_masks()
    assert env.has_attr("action_masks")
    assert plain(VecMonitor(env).env_method("action_masks")) == plain(list(masks))
    assert masks[0].shape == (6 * 2 if view is SwarmVectorEnv else 6,)
    assert plain(env.env_method("action_masks", indices=[2, 0])) == plain([masks[2], masks[0]])


@both_views
def test_maskable_ppo_learns_and_keeps_to_the_masks(view):
    contrib = pytest.importorskip("sb3_contrib")
    how = {"observation": "flat", "right_of_way": True, "autoreset_mode": "SameStep"}
    env = SB3VecEnv(view(8, **how, **SMALL))
    model = contrib.MaskablePPO("MlpPolicy", env, n_steps=16, batch_size=32, n_epochs=2, seed=1)
    model.learn(2 * 16 * env.num_envs)
    seen = env.reset()
    endings = set()
    for _ in range(30):
        masks = contrib.common.maskable.utils.get_action_masks(env)
        actions, _ = model.predict(seen, action_masks=masks)
        seen, *_ = env.step(actions)
        endings |= set(env.env.batch.endings.tolist())
    assert {Ending.FOUND, Ending.TIME_LIMIT} & endings
    assert not {Ending.COLLISION, Ending.LEFT_GRID} & endings


STILL = {"vector": (0, 0), "person_initial_position": [(0, 0)], "disperse_constant": 0}
EASY: dict[str, Any] = {"grid_size": 2, "n_drones": 2, "timestep_limit": 4, **STILL}
"""The person stays with drone 0, so that random drones find it in some episodes."""


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return [*csv.DictReader(file)]


def test_success_is_logged_and_evaluated(tmp_path):
    def make() -> VecMonitor:
        how = {"observation": "flat", "autoreset_mode": "SameStep", "reward_scale": 2.0**-17}
        return VecMonitor(SB3VecEnv(DroneVectorEnv(8, **how, **EASY)))

    evaluation = EvalCallback(make(), n_eval_episodes=32, eval_freq=16, log_path=str(tmp_path))
    logger = configure(str(tmp_path), ["csv"])
    model = PPO("MlpPolicy", make(), n_steps=16, batch_size=64, n_epochs=1, seed=0, device="cpu")
    model.set_logger(logger)
    model.learn(3 * 16 * 16, callback=[evaluation])
    logger.close()
    rows = rows_of(tmp_path / "progress.csv")
    for name in ("rollout/success_rate", "eval/success_rate"):
        rates = [float(row[name]) for row in rows if row.get(name)]
        assert rates and all(0 <= rate <= 1 for rate in rates)
    assert 0 < float(rows[-1]["rollout/success_rate"]) < 1
    with np.load(tmp_path / "evaluations.npz") as saved:
        assert saved["successes"].shape[1] == 32


@both_views
@pytest.mark.parametrize(
    ("layout", "masks"),  # Stable-Baselines3 refuses nested dicts
    [*itertools.product(["flat", "dict", "planes", "crops"], [None, "info"])]
    + [(layout, "observation") for layout in ("flat", "planes", "crops")],
)
def test_a_saved_model_is_a_policy(tmp_path, view, layout, masks):
    """It plays as the model in memory does."""
    contrib = pytest.importorskip("sb3_contrib")
    env = made(view, 4, observation=layout, action_mask=masks, right_of_way=masks is not None)
    kind = "MultiInputPolicy" if layout == "dict" or masks == "observation" else "MlpPolicy"
    make = contrib.MaskablePPO if masks == "info" else PPO
    model = make(kind, env, n_steps=8, batch_size=16, seed=1, device="cpu")
    model.save(tmp_path / "model.zip")
    form = "swarm" if view is SwarmVectorEnv else "drone"
    shown = View(form, layout, masks is not None, masks is not None, bayesian_update=True)
    made_of = type("Saved", (SB3Policy,), {"view": shown})(
        Scenario(**SMALL), tmp_path / "model.zip"
    )
    saved = evaluate(made_of, Scenario(**SMALL), episodes=20, name="model")
    assert saved.view == shown
    told = evaluate(
        TrainedPolicy(logits(model)), Scenario(**SMALL), episodes=20, name="model", view=shown
    )
    assert data_of(saved) == data_of(told)


def test_a_saved_model_for_other_searches_is_refused(tmp_path):
    model = PPO("MlpPolicy", made(DroneVectorEnv, 4, observation="flat"), n_steps=8, batch_size=16)
    model.save(tmp_path / "model.zip")
    with pytest.raises(ValueError, match=r"the model must observe a search like this as View\("):
        SB3Policy(Scenario(**SMALL), tmp_path / "model.zip")
    DQN("MlpPolicy", "DroneSwarmSearch-v0", buffer_size=10).save(tmp_path / "dqn.zip")
    with pytest.raises(ValueError, match=r"dqn\.zip must hold an actor-critic model, got .*DQN"):
        SB3Policy(Scenario(**SMALL), tmp_path / "dqn.zip")


@pytest.mark.filterwarnings("error")
def test_the_gymnasium_id_is_taken_as_it_is():
    contrib = pytest.importorskip("sb3_contrib")
    for arguments in ({}, {"observation": "top-cells"}, {"action_mask": "observation"}):
        check_env(gymnasium.make("DroneSwarmSearch-v0", **arguments))
    settings = {"n_steps": 16, "batch_size": 16, "n_epochs": 1, "seed": 1, "device": "cpu"}
    PPO("MlpPolicy", "DroneSwarmSearch-v0", **settings).learn(32)
    masked = contrib.MaskablePPO("MlpPolicy", "DroneSwarmSearch-v0", **settings)
    masked.learn(64)
    assert masked.ep_success_buffer is not None
    envs = make_vec_env("DroneSwarmSearch-v0", 2, env_kwargs={"observation": "dict"})
    model = PPO("MultiInputPolicy", envs, **settings)
    model.learn(64)
    assert model.num_timesteps == 64


def test_the_log_has_the_probability_of_success_of_every_episode(tmp_path):
    class Collect(BaseCallback):
        seen: ClassVar[list[float]] = []

        def _on_step(self) -> bool:
            for index in np.flatnonzero(self.locals["dones"]):
                self.seen.append(self.locals["infos"][index]["probability_of_success"])
            return True

    task = {**EASY, "mission": "coverage", "grid_size": 3}
    env = DroneVectorEnv(16, observation="flat", autoreset_mode="SameStep", **task)
    model = PPO("MlpPolicy", VecMonitor(SB3VecEnv(env)), n_steps=40, batch_size=1280, seed=0)
    model.set_logger(configure(str(tmp_path), ["csv"]))
    model.learn(2 * 640, [Collect(), LogSuccess()])
    model.logger.close()
    [row] = rows_of(tmp_path / "progress.csv")
    assert 0 < np.mean(Collect.seen) < 1
    logged = float(row["rollout/probability_of_success"])
    assert logged == pytest.approx(np.mean(Collect.seen), rel=1e-5)


def test_other_environments_are_refused():
    with pytest.raises(ValueError, match="env must have autoreset_mode='SameStep', got 'Disabled'"):
        SB3VecEnv(DroneVectorEnv(2, autoreset_mode="Disabled"))
