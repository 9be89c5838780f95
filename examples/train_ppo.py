"""PPO in one file of plain PyTorch: one network for all drones, trained on random searches.

    python examples/train_ppo.py --out runs/ppo

This script trained the package's policy "ppo". Every episode is a different search: the drift,
the person's start, the dispersion and the drones' start cells are drawn at random, on grids of
three sizes with one to eight drones. Observations in the layout "crops" have the same length in
all of them, so one network serves any grid and any number of drones. The weights are saved as
policy.npz, which the package runs without PyTorch:

    PPOPolicy(env.scenario, "runs/ppo/policy.npz")

Structure and names follow CleanRL (S. Huang et al., JMLR 23, 2022). Two things are specific to
search:

- The reward of a search action is its probability of success instead of its outcome. The
  return has the same mean as a reward for finding the person, and a much lower variance.
- The drones of a swarm choose one after another, and each knows where the earlier ones are
  going. They never collide.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

# Set before PyTorch starts its threads, which otherwise spin while they wait for each other.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from DroneSwarmSearch import Action, Ending
from DroneSwarmSearch.evaluation import search
from DroneSwarmSearch.policies.ppo import Network, PPOPolicy
from DroneSwarmSearch.training import Run, arguments, compare_with_baselines
from DroneSwarmSearch.vector import DroneVectorEnv, Sampler
from DroneSwarmSearch.wrappers.masks import choose_in_turn

Parameters = dict[str, Any]

BATCHES: tuple[tuple[Parameters, Parameters], ...] = (
    ({"grid_size": 40, "n_drones": 4}, {"num_swarms": 144}),
    ({"grid_size": 30, "n_drones": 8}, {"num_swarms": 40, "timestep_limit": 80}),
    ({"grid_size": 20, "n_drones": 2}, {"num_swarms": 192, "probability_of_detection": 0.6}),
    ({"grid_size": 20, "n_drones": 1}, {"num_swarms": 192, "timestep_limit": 80}),
)
"""The batches that the network is trained on: the size of each, and its other parameters."""

TEST_SEARCH = "classic"
"""The search of the evaluation suite for the comparison with the baselines."""

HIDDEN = 128  # units in each of the two hidden layers
NUM_STEPS = 32  # steps of each environment between updates
UPDATE_EPOCHS = 3
MINIBATCH_SIZE = 2048
LEARNING_RATE = 1e-3  # at the start; annealed to a twentieth
GAMMA = 0.99
GAE_LAMBDA = 0.95
CLIP_COEF = 0.2
ENT_COEF = 0.003  # at the start; annealed to zero
VF_COEF = 2.0
MAX_GRAD_NORM = 0.5
NUM_ACTIONS = len(Action) - 1  # all but idling: a search is free here and never worse


def sampler(grid_size: int, n_drones: int) -> Sampler:
    """Draw random searches; the drift is at most half a cell per step along each axis."""
    bands = np.linspace(0, grid_size, n_drones + 1).astype(int)

    def draw(rng: Any) -> Mapping[str, Any]:
        # Start cells: either a row of neighbours, or one cell in each band of the grid.
        first = rng.integers(0, grid_size**2 - n_drones)
        in_line = np.stack(np.divmod(first[:, None] + np.arange(n_drones), grid_size)[::-1], -1)
        x = rng.integers(0, grid_size, n_drones)
        y = rng.integers(bands[:-1], bands[1:], n_drones)
        together = rng.random()[:, None, None] < 0.5
        return {
            "vector": rng.uniform(-0.5, 0.5, 2),
            "person_initial_position": rng.integers(0, grid_size, (1, 2)),
            "disperse_constant": np.exp(rng.uniform(0.0, np.log(15.0))),
            "drones_positions": np.where(together, in_line, np.stack([x, y], -1)),
        }

    return draw


def mlp(inputs: int, outputs: int, std: float) -> nn.Sequential:
    last = nn.Linear(HIDDEN, outputs)
    nn.init.orthogonal_(last.weight, std)
    nn.init.zeros_(last.bias)
    return nn.Sequential(
        nn.Linear(inputs, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, HIDDEN), nn.ReLU(), last
    )


class Agent(nn.Module):
    """Actor and critic, which every drone shares."""

    def __init__(self, inputs: int) -> None:
        super().__init__()
        self.actor = mlp(inputs, NUM_ACTIONS, std=0.01)
        self.critic = mlp(inputs, 1, std=0.1)

    def get_value(self, obs: torch.Tensor) -> torch.Tensor:
        """Values, shape (n,), of observations of n drones."""
        value: torch.Tensor = self.critic(obs)[:, 0]
        return value

    def network(self) -> Network:
        """The actor in the form that the package runs in NumPy."""
        layers = [layer for layer in self.actor if isinstance(layer, nn.Linear)]
        return Network(
            [(layer.weight.detach().numpy().T, layer.bias.detach().numpy()) for layer in layers]
        )


class Searches:
    """A batch of searches of one size, stepped with logits instead of actions."""

    def __init__(self, seed: int, **parameters: Any) -> None:
        self.envs = DroneVectorEnv(observation="crops", **parameters)
        self.batch = self.envs.batch
        scenario = self.batch.scenario_of(0)
        self.grid_size, self.n_drones = scenario.grid_size, scenario.n_drones
        self.timestep_limit = scenario.timestep_limit
        self.detection = scenario.detections[0]
        self.obs, _ = self.envs.reset(seed=seed)
        self.episode_returns = np.zeros(len(self.batch.ended))
        self.steps = 0

    def step(
        self, logits: NDArray[np.float32], rng: np.random.Generator, statistics: Statistics
    ) -> dict[str, NDArray[Any]]:
        """Sample the actions of all drones, and step; returns the transitions."""
        logits = logits.reshape(-1, self.n_drones, NUM_ACTIONS)
        cells = self.batch.cells
        # The largest of logits with Gumbel noise is a sample from their softmax.
        noisy = logits + rng.gumbel(size=logits.shape)
        actions, masks = choose_in_turn(noisy, cells, self.grid_size)

        # The probability that a search finds the person: it is there, and it is detected.
        rewards = np.zeros(actions.shape, np.float32)
        rows, drones = (actions == Action.SEARCH).nonzero()
        rewards[rows, drones] = self.detection * self.batch.probabilities(rows, cells[rows, drones])

        valid = ~self.batch.ended.repeat(self.n_drones)  # others reset, and ignore the action
        self.obs, _, dones, _, _ = self.envs.step(actions.reshape(-1))
        self.steps += 1
        statistics.add(self)
        return {
            "actions": actions.reshape(-1),
            "masks": masks.reshape(-1, NUM_ACTIONS),
            "rewards": rewards.reshape(-1),
            "dones": dones,
            "valid": valid,
        }


class Statistics:
    """Returns and successes of the episodes that ended since the last row of the curve.

    Batched episodes start together, so the first to end are the successful ones. Episodes of
    the first two time limits are left out for that reason.
    """

    def __init__(self) -> None:
        self.returns: list[float] = []
        self.found: list[bool] = []

    def add(self, searches: Searches) -> None:
        searches.episode_returns += searches.batch.rewards.mean(axis=1)
        ended = searches.batch.ended
        if searches.steps > 2 * searches.timestep_limit:
            self.returns += searches.episode_returns[ended].tolist()
            self.found += (searches.batch.endings[ended] == Ending.FOUND).tolist()
        searches.episode_returns[ended] = 0.0

    def take(self) -> dict[str, float | None]:
        """The mean return of a drone and the success rate; starts over."""
        episodes = len(self.found)
        reward = sum(self.returns) / episodes if episodes else None
        found = sum(self.found) / episodes if episodes else None
        self.returns, self.found = [], []
        return {"reward": reward, "found": found}


def rollout(
    agent: Agent, batches: list[Searches], rng: np.random.Generator, statistics: Statistics
) -> dict[str, torch.Tensor]:
    """Step all searches; returns the transitions with advantages and returns, flattened."""
    num_drones = sum(searches.envs.num_envs for searches in batches)
    obs = np.empty((NUM_STEPS + 1, num_drones, *batches[0].obs.shape[1:]), np.float32)
    steps: list[dict[str, NDArray[Any]]] = []
    for next_obs in obs[:-1]:
        np.concatenate([searches.obs for searches in batches], out=next_obs)
        with torch.no_grad():
            inputs = torch.from_numpy(next_obs)
            logits, values = agent.actor(inputs), agent.get_value(inputs)
        first, parts = 0, []
        for searches in batches:
            last = first + searches.envs.num_envs
            parts.append(searches.step(logits[first:last].numpy(), rng, statistics))
            first = last
        step = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
        masked = logits.masked_fill(~torch.from_numpy(step["masks"]), -torch.inf)
        actions = torch.from_numpy(step["actions"])[:, None]
        logprobs = masked.log_softmax(dim=1).gather(1, actions)[:, 0]
        steps.append({"values": values.numpy(), "logprobs": logprobs.numpy(), **step})

    np.concatenate([searches.obs for searches in batches], out=obs[-1])
    with torch.no_grad():
        nextvalues = agent.get_value(torch.from_numpy(obs[-1])).numpy()
    data = {key: np.stack([step[key] for step in steps]) for key in steps[0]}
    advantages = np.zeros_like(data["values"])
    lastgaelam = np.zeros_like(nextvalues)
    for t in reversed(range(NUM_STEPS)):
        # The time limit is terminal as well: the drones observe the remaining time.
        nextnonterminal = 1.0 - data["dones"][t]
        delta = data["rewards"][t] + GAMMA * nextnonterminal * nextvalues - data["values"][t]
        lastgaelam = delta + GAMMA * GAE_LAMBDA * nextnonterminal * lastgaelam
        advantages[t], nextvalues = lastgaelam, data["values"][t]
    transitions = {
        "obs": obs[:-1],
        "advantages": advantages,
        "returns": advantages + data["values"],
        **{key: data[key] for key in ("actions", "masks", "logprobs", "valid")},
    }
    return {key: torch.from_numpy(each).flatten(0, 1) for key, each in transitions.items()}


def update(
    agent: Agent, optimizer: torch.optim.Optimizer, data: dict[str, torch.Tensor], frac: float
) -> float:
    """Update the agent; `frac` is the fraction of the training that remains.

    Returns the entropy of the policy.
    """
    for group in optimizer.param_groups:
        group["lr"] = LEARNING_RATE * max(frac, 0.05)
    valid, entropy = data["valid"].nonzero()[:, 0], torch.zeros(())
    for _ in range(UPDATE_EPOCHS):
        for mb_inds in valid[torch.randperm(len(valid))].split(MINIBATCH_SIZE):
            mb = {key: values[mb_inds] for key, values in data.items()}
            logits = agent.actor(mb["obs"]).masked_fill(~mb["masks"], -1e9)
            all_logprobs = logits.log_softmax(dim=1)
            newlogprob = all_logprobs.gather(1, mb["actions"][:, None])[:, 0]
            ratio = (newlogprob - mb["logprobs"]).exp()
            advantages = mb["advantages"]
            advantages = (advantages - advantages.mean()) / (advantages.std() + 1e-8)
            clipped = ratio.clamp(1 - CLIP_COEF, 1 + CLIP_COEF)
            pg_loss = -torch.min(ratio * advantages, clipped * advantages).mean()
            v_loss = (agent.get_value(mb["obs"]) - mb["returns"]).square().mean()
            entropy = -(all_logprobs.exp() * all_logprobs).sum(dim=1).mean()
            loss = pg_loss - ENT_COEF * frac * entropy + VF_COEF * v_loss
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(agent.parameters(), MAX_GRAD_NORM)
            optimizer.step()
    return entropy.item()


def train(run: Run, seed: int) -> None:
    torch.manual_seed(seed)
    first_seed, checkpoint = seed, None
    if run.resuming:
        checkpoint = torch.load(run.checkpoint, weights_only=True)
        run.resume_from(checkpoint["steps"])
        first_seed += checkpoint["steps"]  # new searches
    batches = [
        Searches(
            first_seed + 10_000_019 * number,
            sampler=sampler(**size),
            bayesian_update=True,
            **size,
            **parameters,
        )
        for number, (size, parameters) in enumerate(BATCHES)
    ]
    agent = Agent(batches[0].obs.shape[1])
    optimizer = torch.optim.Adam(agent.parameters(), eps=1e-5, fused=True)
    if checkpoint is not None:
        agent.load_state_dict(checkpoint["agent"])
        optimizer.load_state_dict(checkpoint["optimizer"])
    rng, statistics = np.random.default_rng(first_seed), Statistics()
    steps_per_rollout = NUM_STEPS * sum(parameters["num_swarms"] for _, parameters in BATCHES)

    if checkpoint is None:
        save(run, agent, optimizer, 0)
    while run.steps_done < run.total_steps:
        frac = 1.0 - run.steps_done / run.total_steps
        data = rollout(agent, batches, rng, statistics)
        entropy = update(agent, optimizer, data, frac)
        steps = run.steps_done + steps_per_rollout
        save(run, agent, optimizer, steps)
        run.log(steps, entropy=entropy, **statistics.take())


def save(run: Run, agent: Agent, optimizer: torch.optim.Optimizer, steps: int) -> None:
    """Save the weights, then the checkpoint, whose number of steps --resume relies on."""
    with run.saving("policy.npz") as path:
        agent.network().save(path)
    state = {"agent": agent.state_dict(), "optimizer": optimizer.state_dict(), "steps": steps}
    with run.saving("checkpoint.pt") as path:
        torch.save(state, path)


def main() -> None:
    description = "Train one network for all drones with PPO, on random searches."
    options = arguments(description, steps=12_000_000, short=130_000).parse_args()
    with Run(options, "PPO in one file") as run:
        train(run, options.seed)
    test = search(TEST_SEARCH)
    policy = PPOPolicy(test.scenario, run.folder / "policy.npz")
    print(f'\nOn the search "{TEST_SEARCH}", which is not part of the training:\n')
    compare_with_baselines(
        policy,
        test.parameters,
        view="swarm",
        observation="dict",
        episodes=options.episodes,
        name="ppo",
        folder=run.folder,
    )


if __name__ == "__main__":
    main()
