"""Train drones with PPO in one file of plain PyTorch, on a batch of random searches.

    pip install "DroneSwarmSearchEnvironment[ppo]"
    python examples/train_own_loop.py --out runs/first

Every episode is a new search: drift, dispersion, the person's start and the drones' start cells are
drawn at random. One network controls all drones; its observations, the layout "crops", have one
length for any grid and swarm. Masks prevent crashes. Names follow CleanRL (S. Huang et al., JMLR
23, 2022).

The drones train in the coverage mission: nobody is found, and a search pays the drone the
probability of success that it adds. This is the mean of a reward for finding, without its variance.

With ``--task wreck`` or another task of the benchmark, they train on its searches instead.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from os.path import relpath
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from tqdm import tqdm
from training_script import begin, finish

from DroneSwarmSearch import Action, RewardScheme, Scenario, training
from DroneSwarmSearch.adapters import TrainedPolicy
from DroneSwarmSearch.evaluation import Evaluation, NamedSearch, View, evaluate, search
from DroneSwarmSearch.training import TASKS
from DroneSwarmSearch.vector import DroneVectorEnv

INPUTS = 202
GRID_SIZE = 25
DRONES = 4
POS = "probability_of_success"
NUM_STEPS = 32
UPDATE_EPOCHS = 3
MINIBATCH_SIZE = 4096
HIDDEN = 64
# at the start; annealed
LEARNING_RATE = 3e-3
ENT_COEF = 0.003
GAMMA = 0.99
GAE_LAMBDA = 0.95
CLIP_COEF = 0.2
VF_COEF = 30.0
MAX_GRAD_NORM = 0.5
TEST_SEARCH = "classic"  # of the evaluation suite, for the comparison with the baselines
TEST_SEED = 10_000_000  # of random searches for the baselines; training starts from small seeds


def sampler(rng: np.random.Generator) -> dict[str, Any]:
    """Draw a search; each drone starts in its own band of rows."""
    bands = np.linspace(0, GRID_SIZE, DRONES + 1).astype(int)
    x, y = rng.integers(0, GRID_SIZE, DRONES), rng.integers(bands[:-1], bands[1:], DRONES)
    return {
        "vector": rng.uniform(-0.5, 0.5, 2),
        "person_initial_position": rng.integers(0, GRID_SIZE, 2),
        "disperse_constant": np.exp(rng.uniform(0.0, np.log(15.0))),
        "drones_positions": np.stack([x, y], axis=-1),
    }


RANDOM_SEARCHES = {
    "grid_size": GRID_SIZE,
    "n_drones": DRONES,
    "timestep_limit": 80,
    "bayesian_update": True,
    "mission": "coverage",
    "sampler": sampler,
}


def make_envs(searches: int, parameters: Mapping[str, Any]) -> DroneVectorEnv:
    return DroneVectorEnv(
        searches,
        observation="crops",
        action_mask="observation",
        right_of_way=True,
        autoreset_mode="SameStep",
        **parameters,
    )


class Agent(nn.Module):
    """Actor and critic, which all drones share."""

    def __init__(self) -> None:
        super().__init__()
        hidden = nn.Linear(INPUTS, HIDDEN), nn.ReLU(True), nn.Linear(HIDDEN, HIDDEN), nn.ReLU(True)
        last = nn.Linear(HIDDEN, len(Action) + 1)
        nn.init.orthogonal_(last.weight, 0.01)
        self.network = nn.Sequential(*hidden, last)

    def forward(self, obs: torch.Tensor, masks: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """The log-probability of each action, shape (6, n), and the values, shape (n,)."""
        outputs = self.network(obs).T.contiguous()  # operations along a long last axis are fast
        logits = outputs[:-1].masked_fill(masks.T == 0, -1e9)
        return logits.log_softmax(dim=0), outputs[-1]

    @torch.no_grad()
    def act(self, observations: dict[str, NDArray[Any]]) -> dict[str, torch.Tensor]:
        """Sample an action for each drone."""
        obs, masks = (torch.from_numpy(observations[key]) for key in ("observation", "action_mask"))
        logprobs, values = self(obs, masks)
        actions = (logprobs.exp() / torch.empty_like(logprobs).exponential_()).argmax(dim=0)
        chosen = logprobs.gather(0, actions[None])[0]
        step = {"obs": obs, "masks": masks, "actions": actions}
        return {**step, "logprobs": chosen, "values": values}


class Trained(TrainedPolicy):
    """The policy of a checkpoint, for `evaluate`, `record` and `play`."""

    def __init__(self, scenario: Scenario, checkpoint: str) -> None:
        torch.set_num_threads(1)
        agent = Agent()
        agent.load_state_dict(torch.load(checkpoint, weights_only=True)["agent"])

        def logits(observations: dict[str, NDArray[Any]]) -> NDArray[Any]:
            names = "observation", "action_mask"
            with torch.no_grad():
                return agent(*(torch.from_numpy(observations[key]) for key in names))[0].numpy().T

        super().__init__(logits, view=View("drone", "crops", True, True, bayesian_update=True))


def rollout(
    envs: DroneVectorEnv,
    agent: Agent,
    data: dict[str, torch.Tensor],
    observations: Any,
    gamma: float,
) -> tuple[Any, list[float]]:
    """Step all searches, and write the transitions into `data`, whose arrays are reused.

    Returns the next observations, and for each episode that ended the probability of success, or of
    several persons the share that was found.
    """
    ended: list[float] = []
    for t in range(NUM_STEPS):
        step = agent.act(observations)
        observations, rewards, dones, _, infos = envs.step(step["actions"].numpy())
        step["rewards"] = torch.from_numpy(rewards).float()
        step["dones"] = torch.from_numpy(dones)
        for key, values in step.items():
            if key not in data:
                data[key] = values.new_empty(NUM_STEPS, *values.shape)
            data[key][t] = values
        if dones.any():
            final = infos["final_info"]
            several = final["persons_found"].shape[1] > 1
            found = final["persons_found"].mean(axis=1) if several else final[POS]
            ended += found[dones].tolist()
    add_advantages(data, agent.act(observations)["values"], gamma)
    return observations, ended


def add_advantages(data: dict[str, torch.Tensor], next_values: torch.Tensor, gamma: float) -> None:
    """Add advantages and returns. Every end is terminal: the drones observe the remaining time."""
    advantages = torch.zeros_like(data["values"])
    last = torch.zeros_like(next_values)
    for t in reversed(range(NUM_STEPS)):
        nextnonterminal = ~data["dones"][t]
        delta = data["rewards"][t] + gamma * nextnonterminal * next_values - data["values"][t]
        last = delta + gamma * GAE_LAMBDA * nextnonterminal * last
        advantages[t] = last
        next_values = data["values"][t]
    data["returns"] = advantages + data["values"]
    data["advantages"] = advantages / (advantages.square().mean().sqrt() + 1e-8)


def update(
    agent: Agent,
    optimizer: torch.optim.Optimizer,
    data: dict[str, torch.Tensor],
    options: argparse.Namespace,
    frac: float,
) -> float:
    """Update the agent, with the fraction of the training that remains; returns the entropy."""
    optimizer.param_groups[0]["lr"] = options.lr * max(frac, 0.05)
    used = "obs", "masks", "actions", "logprobs", "advantages", "returns"
    data = {key: data[key].flatten(0, 1) for key in used}
    arrays = {key: values[:MINIBATCH_SIZE].clone() for key, values in data.items()}
    for _ in range(UPDATE_EPOCHS):
        for indices in torch.randperm(len(data["actions"])).split(MINIBATCH_SIZE):
            mb = {key: out[: len(indices)] for key, out in arrays.items()}
            for key, values in data.items():
                torch.index_select(values, 0, indices, out=mb[key])
            logprobs, values = agent(mb["obs"], mb["masks"])
            ratio = (logprobs.gather(0, mb["actions"][None])[0] - mb["logprobs"]).exp()
            clipped = ratio.clamp(1 - CLIP_COEF, 1 + CLIP_COEF)
            pg_loss = -torch.min(ratio * mb["advantages"], clipped * mb["advantages"]).mean()
            entropy = -(logprobs.exp() * logprobs).sum(dim=0).mean()
            v_loss = (values - mb["returns"]).square().mean()
            loss = pg_loss - options.entropy * frac * entropy + VF_COEF * v_loss
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(agent.parameters(), MAX_GRAD_NORM)
            optimizer.step()
    return entropy.item()


def train(agent: Agent, options: argparse.Namespace) -> None:
    checkpoint = options.out / "checkpoint.pt"
    curve = options.out / "curve.csv"
    optimizer = torch.optim.Adam(agent.parameters(), eps=1e-5, fused=True)
    steps = 0
    seconds = 0.0
    if options.resume:
        state = torch.load(checkpoint, weights_only=True)
        agent.load_state_dict(state["agent"])
        optimizer.load_state_dict(state["optimizer"])
        steps = state["steps"]
        seconds = state["seconds"]
        torch.manual_seed(options.seed + steps)
    started = time.monotonic() - seconds
    searches = TASKS[options.task].training if options.task else RANDOM_SEARCHES
    envs = make_envs(options.swarms, searches)
    # A resumed training plays new searches.
    observations, _ = envs.reset(seed=options.seed + steps)
    data: dict[str, torch.Tensor] = {}
    ended: list[float] = []
    while steps < options.steps:
        observations, successes = rollout(envs, agent, data, observations, options.gamma)
        entropy = update(agent, optimizer, data, options, 1.0 - steps / options.steps)
        steps = steps + NUM_STEPS * options.swarms
        seconds = time.monotonic() - started
        state = {"agent": agent.state_dict(), "optimizer": optimizer.state_dict()}
        torch.save({**state, "steps": steps, "seconds": seconds}, checkpoint.with_suffix(".new"))
        checkpoint.with_suffix(".new").replace(checkpoint)  # never leave half a checkpoint
        ended += successes
        if len(ended) >= envs.num_envs // 2:  # the few that end early are the easy ones
            found = float(np.mean(ended))
            training.log_row(curve, steps=steps, seconds=seconds, found=found, entropy=entropy)
            ended = []


def random_searches(count: int) -> list[NamedSearch]:
    """Searches for a person, drawn like those in training."""
    envs = make_envs(count, RANDOM_SEARCHES)
    found = []
    envs.reset(seed=TEST_SEED)
    for row in range(count):
        scenario = envs.batch.scenario_of(row).replace(
            mission="rescue", reward_scheme=RewardScheme(), bayesian_update=False
        )
        drones = tuple((x, y) for x, y in envs.batch.positions[row].tolist())
        found.append(NamedSearch(f"random-{row}", "A random search.", scenario, drones))
    return found


def baselines(searches: list[NamedSearch]) -> list[Evaluation]:
    """Evaluations of policies of the package; one episode gives their exact success."""
    names = ("random", "greedy-matrix", "greedy-posterior")
    print(f"\nEvaluating {', '.join(names)} on {len(searches)} random searches", flush=True)
    pairs = [(name, each) for name in names for each in searches]
    shown = tqdm(pairs, desc="baselines", leave=False, disable=None)  # on terminals
    return [evaluate(name, each, episodes=1, progress=False) for name, each in shown]


def main() -> None:
    options = begin(
        "Train drones with PPO in one file of PyTorch.",
        "checkpoint.pt",
        steps={"type": int, "default": 16_000_000, "help": "environment steps in all"},
        task={"choices": list(TASKS), "help": "of the benchmark, in place of random searches"},
        swarms={"type": int, "default": 256, "help": "searches that are stepped together"},
        lr={
            "type": float,
            "default": LEARNING_RATE,
            "help": "learning rate at the start; it falls to 0",
        },
        entropy={
            "type": float,
            "default": ENT_COEF,
            "help": "its bonus at the start; it falls to 0",
        },
        gamma={"type": float, "default": GAMMA, "help": "the discount"},
    )
    torch.set_num_threads(options.threads)
    torch.manual_seed(options.seed)
    try:
        train(Agent(), options)
    except KeyboardInterrupt:
        raise SystemExit("\ninterrupted: --resume continues from the last update") from None
    if options.no_comparison:
        return
    policy = f"{relpath(__file__)}:Trained:{options.out / 'checkpoint.pt'}"
    if options.task:
        finish(policy, "ppo", options, task=TASKS[options.task])
        return
    if (curve := options.out / "curve.csv").exists():
        title = "Random searches, such as those of the training"
        training.plot_curve(curve, baselines=baselines(random_searches(50)), title=title)
    print(f'\nOn the search "{TEST_SEARCH}", which is not part of the training:')
    training.compare_with_baselines(
        policy,
        search(TEST_SEARCH).with_posterior(True).parameters,
        episodes=options.episodes,
        name="ppo",
        folder=options.out,
    )


if __name__ == "__main__":
    main()
