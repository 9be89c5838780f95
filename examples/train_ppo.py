"""Train the policy "ppo" in plain PyTorch: one network for all drones, on random searches.

    pip install "DroneSwarmSearchEnvironment[ppo]"
    python examples/train_ppo.py --out runs/ppo

This script trained the weights of the package. Every search is different: the grid, the number of
drones, the persons and their drift, the probability of detection and the time limit are drawn at
random. The inputs (`policies.arrivals`) have one length for all of them, so one network serves
any search. The weights are saved as policy.npz, which the package runs without PyTorch:

    PPOPolicy(env.scenario, "runs/ppo/policy.npz")

Structure and names follow CleanRL (S. Huang et al., JMLR 23, 2022). Four things are specific to
search:

- Searches are simulated in expectation (`expected_searches.py`): nobody is found, and the
  reward of a search action is the probability of success that it adds. It has the same mean as a
  reward for finding the person, and no sampling error.
- The network starts as greedy search on the forecast and learns what to add: its last layer also
  sees the greedy scores, and begins with them (residual policy learning: T. Silver et al., 2018).
- The network scores all four directions in the same way, so it need not learn four times.
- The drones of a swarm choose one after another, and each knows where the earlier ones are
  going. They never collide.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from expected_searches import ExpectedSearches
from numpy.typing import NDArray
from ppo_searches import draw_searches, held_out_searches, mean_success
from torch import nn

from DroneSwarmSearch import Action, training
from DroneSwarmSearch.evaluation import evaluate, search
from DroneSwarmSearch.layouts.masks import choose_in_turn
from DroneSwarmSearch.policies.arrivals import BASELINE, INPUTS, TURNS, VIEWS
from DroneSwarmSearch.policies.ppo import Network, PPOPolicy

TEST_SEARCH = "classic"
"""The search of the evaluation suite for the comparison with the baselines."""

BASELINES = ("greedy-matrix", "greedy-posterior", "greedy-forecast")
HELD_OUT = 12  # searches outside the training, to compare with the baselines
EVALUATION = 8  # updates between these comparisons

BATCHES = 8  # batches of searches, each of one size
HIDDEN = 64  # units in each of the two hidden layers
BASELINE_SCALE = 15.0  # of the greedy scores in the logits at the start
NUM_STEPS = 32  # steps of each batch between updates
WARM_UP = 4  # updates of the critic alone, before the actor changes
UPDATE_EPOCHS = 4
MINIBATCH_SIZE = 1024
LEARNING_RATE = 5e-4  # at the start; annealed to a twentieth
GAMMA = 0.99
GAE_LAMBDA = 0.95
TEAM = 0.3  # weight of the other drones' advantages in a drone's
CLIP_COEF = 0.2
ENT_COEF = 0.0005  # at the start; annealed to zero
VF_COEF = 0.5
MAX_GRAD_NORM = 0.5
ENOUGH = 0.93  # mean probability of success at which a batch ends before its time limit
NUM_ACTIONS = len(Action) - 1  # all but idling: a search is free here and never worse

_FROM_VIEW = torch.from_numpy(np.argsort(VIEWS, axis=1))


class Views(nn.Module):
    """A perceptron that observes the inputs in four views; its last layer also sees the inputs.

    The form of `policies.ppo.Network`: shape (n, INPUTS) to shape (n, 4, outputs).
    """

    def __init__(self, outputs: int, std: float) -> None:
        super().__init__()
        self.first, self.second = nn.Linear(INPUTS, HIDDEN), nn.Linear(HIDDEN, HIDDEN)
        self.last = nn.Linear(HIDDEN + INPUTS, outputs)
        nn.init.orthogonal_(self.first.weight)
        nn.init.orthogonal_(self.last.weight[:, :HIDDEN], std)
        nn.init.zeros_(self.last.weight[:, HIDDEN:])
        nn.init.zeros_(self.last.bias)

    def forward(self, inputs: torch.Tensor) -> torch.Tensor:
        hidden = torch.relu(_in_views(inputs, self.first.weight) + self.first.bias)
        hidden = torch.relu(self.second(hidden))
        of_hidden, of_inputs = self.last.weight.split([HIDDEN, INPUTS], dim=1)
        return hidden @ of_hidden.T + _in_views(inputs, of_inputs) + self.last.bias


def _in_views(inputs: torch.Tensor, weight: torch.Tensor) -> torch.Tensor:
    """`inputs[:, VIEWS] @ weight.T`, but the weights are turned instead of the inputs."""
    turned = weight.T[_FROM_VIEW].permute(1, 0, 2)  # [input, view, unit]
    return (inputs @ turned.reshape(INPUTS, -1)).reshape(len(inputs), len(TURNS), -1)


class Agent(nn.Module):
    """Actor and critic, which every drone shares."""

    def __init__(self) -> None:
        super().__init__()
        self.actor, self.critic = Views(2, std=0.01), Views(1, std=0.1)
        with torch.no_grad():
            for output, place in enumerate(BASELINE):
                self.actor.last.weight[output, HIDDEN + place] = BASELINE_SCALE
                # The same with the wider view decides between equal scores.
                self.actor.last.weight[output, HIDDEN + place + 5] = BASELINE_SCALE / 50

    def get_logits(self, obs: torch.Tensor) -> torch.Tensor:
        """Logits of the actions, shape (n, NUM_ACTIONS)."""
        outputs = self.actor(obs)
        moves = outputs[:, np.argsort(TURNS), 0]
        return torch.cat([moves, outputs[:, :, 1].mean(dim=1, keepdim=True)], dim=1)

    def get_value(self, obs: torch.Tensor) -> torch.Tensor:
        """Expected returns relative to the probability that nobody has been found yet: (n,)."""
        value: torch.Tensor = self.critic(obs)[:, :, 0].mean(dim=1)
        return value

    def network(self) -> Network:
        """The actor in the form that the package runs in NumPy."""
        layers = (self.actor.first, self.actor.second, self.actor.last)
        return Network(
            [(layer.weight.detach().numpy().T, layer.bias.detach().numpy()) for layer in layers]
        )


def step(agent: Agent, batch: ExpectedSearches, rng: np.random.Generator) -> dict[str, Any]:
    """Sample the actions of all drones of a batch, and step; returns the transitions."""
    obs = torch.from_numpy(batch.inputs().reshape(-1, INPUTS))
    with torch.no_grad():
        logits, values = agent.get_logits(obs), agent.get_value(obs).numpy()
    # The largest of logits with Gumbel noise is a sample from their softmax.
    noisy = logits.numpy() + rng.gumbel(size=logits.shape)
    by_swarm = noisy.reshape(*batch.positions.shape[:2], NUM_ACTIONS)
    actions, masks = choose_in_turn(by_swarm, batch.cells, batch.grid_size)
    masks = masks.reshape(-1, NUM_ACTIONS)
    masked = logits.masked_fill(~torch.from_numpy(masks), -1e9)
    flat = torch.from_numpy(actions.reshape(-1, 1))
    logprobs = masked.log_softmax(dim=1).gather(1, flat)[:, 0]
    unfound = left_to_find(batch)
    rewards = batch.advance(actions)
    return {
        "obs": obs.numpy(),
        "actions": actions.reshape(-1),
        "masks": masks,
        "logprobs": logprobs.numpy(),
        "rewards": rewards.reshape(-1),
        "values": values * unfound,
        "unfound": unfound,
    }


def new_batch(rng: np.random.Generator) -> ExpectedSearches:
    """Random searches of one size, before their first step."""
    return ExpectedSearches(*draw_searches(rng))


def left_to_find(batch: ExpectedSearches) -> NDArray[np.float64]:
    """For each drone, the probability that nobody has been found yet: above 0, to divide by."""
    return np.maximum(1.0 - batch.found, 1e-6).repeat(batch.n_drones)


def with_advantages(
    steps: list[dict[str, Any]], nextvalues: NDArray[Any] | float, n_drones: int
) -> dict[str, NDArray[Any]]:
    """The transitions of one batch with advantages and returns, flattened.

    Args:
        steps: the transitions of consecutive steps.
        nextvalues: the values after the last one; 0 after the end of the searches.
        n_drones: drones in each search.
    """
    data = {key: np.stack([each[key] for each in steps]) for key in steps[0]}
    rewards, values = data.pop("rewards"), data.pop("values")
    advantages, lastgaelam = np.zeros_like(values), 0.0
    for t in reversed(range(len(steps))):
        delta = rewards[t] + GAMMA * nextvalues - values[t]
        lastgaelam = delta + GAMMA * GAE_LAMBDA * lastgaelam
        advantages[t], nextvalues = lastgaelam, values[t]
    data["returns"] = (advantages + values) / data["unfound"]
    by_swarm = advantages.reshape(len(steps), -1, n_drones)
    others = by_swarm.sum(axis=2, keepdims=True) - by_swarm
    data["advantages"] = (by_swarm + TEAM * others).reshape(values.shape)
    return {key: each.reshape(-1, *each.shape[2:]) for key, each in data.items()}


def rollout(
    agent: Agent, batches: list[ExpectedSearches], rng: np.random.Generator
) -> tuple[dict[str, torch.Tensor], list[ExpectedSearches], int]:
    """Step all batches, and replace those that end.

    Returns:
        The transitions of all drones, the batches that ended, and the number of steps of all
        searches.
    """
    parts, ended, count = [], [], 0
    for number in range(len(batches)):
        steps: list[dict[str, Any]] = []
        for _ in range(NUM_STEPS):
            batch = batches[number]
            steps.append(step(agent, batch, rng))
            count += len(batch.positions)
            # The time limit is terminal: the drones observe the remaining time.
            if batch.step == batch.timestep_limit or batch.found.mean() > ENOUGH:
                parts.append(with_advantages(steps, 0.0, batch.n_drones))
                steps, batches[number] = [], new_batch(rng)
                ended.append(batch)
        if steps:
            obs = torch.from_numpy(batch.inputs().reshape(-1, INPUTS))
            with torch.no_grad():
                values = agent.get_value(obs).numpy()
            parts.append(with_advantages(steps, values * left_to_find(batch), batch.n_drones))
    data = {}
    for key in parts[0]:
        joined = torch.from_numpy(np.concatenate([part[key] for part in parts]))
        data[key] = joined.float() if joined.is_floating_point() else joined
    return data, ended, count


def update(
    agent: Agent,
    optimizer: torch.optim.Optimizer,
    data: dict[str, torch.Tensor],
    frac: float,
    only_critic: bool = False,
) -> float:
    """Update the agent; `frac` is the fraction of the training that remains.

    Returns the entropy of the policy.
    """
    for group in optimizer.param_groups:
        group["lr"] = LEARNING_RATE * max(frac, 0.05)
    scale = data["advantages"].square().mean().sqrt() + 1e-8
    advantages, entropy = (data["advantages"] / scale).clamp(-5.0, 5.0), torch.zeros(())
    for _ in range(UPDATE_EPOCHS):
        for mb_inds in torch.randperm(len(advantages)).split(MINIBATCH_SIZE):
            mb = {key: values[mb_inds] for key, values in data.items()}
            # Late in a search little is left to find, and the value matters less.
            errors = mb["unfound"] * (agent.get_value(mb["obs"]) - mb["returns"]).square()
            v_loss = errors.mean() / (mb["unfound"] * mb["returns"].square()).mean().clamp(1e-6)
            logits = agent.get_logits(mb["obs"]).masked_fill(~mb["masks"], -1e9)
            all_logprobs = logits.log_softmax(dim=1)
            newlogprob = all_logprobs.gather(1, mb["actions"][:, None])[:, 0]
            ratio = (newlogprob - mb["logprobs"]).exp()
            mb_advantages = advantages[mb_inds] - advantages[mb_inds].mean()
            clipped = ratio.clamp(1 - CLIP_COEF, 1 + CLIP_COEF)
            pg_loss = -torch.min(ratio * mb_advantages, clipped * mb_advantages).mean()
            entropy = -(all_logprobs.exp() * all_logprobs).sum(dim=1).mean()
            loss = VF_COEF * v_loss
            if not only_critic:
                loss = loss + pg_loss - ENT_COEF * frac * entropy
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(agent.parameters(), MAX_GRAD_NORM)
            optimizer.step()
    return entropy.item()


def train(options: argparse.Namespace) -> Path:
    """Train for all steps; returns the path of the weights."""
    curve, weights = options.out / "curve.csv", options.out / "policy.npz"
    torch.manual_seed(options.seed)
    agent = Agent()
    optimizer = torch.optim.Adam(agent.parameters(), eps=1e-5)
    held_out = held_out_searches(HELD_OUT)
    rng = np.random.default_rng([options.seed, 0])
    batches = [new_batch(rng) for _ in range(BATCHES)]
    steps = updates = 0
    while steps < options.steps:
        frac = 1.0 - steps / options.steps
        data, ended, count = rollout(agent, batches, rng)
        entropy = update(agent, optimizer, data, frac, only_critic=updates < WARM_UP)
        steps, updates = steps + count, updates + 1
        agent.network().save(weights)
        found = np.mean([min(batch.found.mean(), 1.0) for batch in ended]) if ended else np.nan
        row = {"steps": steps, "found": float(found), "entropy": entropy, "held-out": np.nan}
        if updates == 1 or updates % EVALUATION == 0:
            alone = partial(PPOPolicy, weights=weights, samples=None)
            row["held-out"] = mean_success(alone, held_out)
        training.log_row(curve, **row)
    baselines = [evaluate(name, each, episodes=1) for name in BASELINES for each in held_out]
    training.plot_curve(curve, columns=["held-out"], baselines=baselines)
    return weights


def main() -> None:
    parser = argparse.ArgumentParser(description='Train the policy "ppo" on random searches.')
    parser.add_argument("--out", type=Path, required=True, help="folder of the training")
    parser.add_argument("--steps", type=int, default=180_000, help="environment steps in all")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=1, help="of PyTorch; more rarely help (1)")
    parser.add_argument("--episodes", type=int, default=1000, help="of the comparison")
    options = parser.parse_args()
    if options.out.exists():
        parser.error(f"{options.out} exists: choose another folder")
    options.out.mkdir(parents=True)
    torch.set_num_threads(options.threads)
    weights = train(options)
    print(f'\nOn the search "{TEST_SEARCH}", which is not part of the training:\n')
    training.compare_with_baselines(
        str(weights),
        search(TEST_SEARCH).parameters,
        episodes=options.episodes,
        name="ppo",
        folder=options.out,
    )


if __name__ == "__main__":
    main()
