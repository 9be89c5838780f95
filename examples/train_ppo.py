"""PPO in one file, in plain PyTorch: one network for every drone, thousands of drones at once.

    python examples/train_ppo.py --out runs/ppo

Trains the policy "ppo" of the package. Every episode is another search: drift, the person's
start, how fast they stray and the drones' places are drawn at random, on grids of three sizes
with one to eight drones. What a drone is shown has the same form in all of them
(observation="crops"), so that one network learns from all and flies in any. The folder gets
the weights as policy.npz, which the package runs without PyTorch:

    PPOPolicy(env.scenario, "runs/ppo/policy.npz")

The form is CleanRL's: S. Huang and others, CleanRL, JMLR 23, 2022. Two things are special to
searches. A search is rewarded with its chance of success, not with its luck: the sum over an
episode has the same mean as finding the person has, and far less noise. Each drone is paid for
its own searches; what others have searched is worth little to it, as the posterior says. And
the drones of a swarm choose in turn, each knowing where those before it are about to go, so
they never collide.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

# Before PyTorch starts its threads: where others work, too, they would wait for each other
# spinning, which takes several times as long.
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

FAMILY: tuple[tuple[Parameters, Parameters], ...] = (
    ({"grid_size": 40, "n_drones": 4}, {"num_swarms": 144}),
    ({"grid_size": 30, "n_drones": 8}, {"num_swarms": 40, "timestep_limit": 80}),
    ({"grid_size": 20, "n_drones": 2}, {"num_swarms": 192, "probability_of_detection": 0.6}),
    ({"grid_size": 20, "n_drones": 1}, {"num_swarms": 192, "timestep_limit": 80}),
)
"""The batches of searches trained on together: their sizes, and what else is not as usual."""

UNSEEN = "classic"
"""The search of the evaluation suite on which the result is compared with the baselines."""

HIDDEN = 128  # units in each of the two hidden layers
ROLLOUT = 32  # steps between updates
EPOCHS = 3  # passes over what a rollout brought
MINIBATCH = 2048  # transitions
LEARNING_RATE = 1e-3  # at the beginning; falls to a twentieth
DISCOUNT, TRACE = 0.99, 0.95  # gamma and lambda of the advantages
CLIP, VALUE, GRADIENT = 0.2, 2.0, 0.5  # of PPO's loss; the gradient's norm
ENTROPY = 0.003  # its weight in the loss at the beginning; falls to nothing
ACTIONS = len(Action) - 1  # without idling: a search costs nothing here

Singles = NDArray[np.float32]
FOUND = Ending.FOUND


def sampler(grid_size: int, n_drones: int) -> Sampler:
    """Draws searches: drift up to half a cell a step along each axis, anything anywhere."""
    bands = np.linspace(0, grid_size, n_drones + 1).astype(int)

    def draw(rng: Any) -> Mapping[str, Any]:
        first = rng.integers(0, grid_size**2 - n_drones)
        in_line = np.stack(np.divmod(first[:, None] + np.arange(n_drones), grid_size)[::-1], -1)
        x = rng.integers(0, grid_size, n_drones)
        y = rng.integers(bands[:-1], bands[1:], n_drones)  # a band each: never in one cell
        together = rng.random()[:, None, None] < 0.5
        return {
            "vector": rng.uniform(-0.5, 0.5, 2),
            "person_initial_position": rng.integers(0, grid_size, (1, 2)),
            "disperse_constant": np.exp(rng.uniform(0.0, np.log(15.0))),
            "drones_positions": np.where(together, in_line, np.stack([x, y], -1)),
        }

    return draw


def dense(inputs: int, outputs: int, scale: float) -> nn.Sequential:
    """Two hidden layers; the last layer's weights begin small."""
    last = nn.Linear(HIDDEN, outputs)
    nn.init.orthogonal_(last.weight, scale)
    nn.init.zeros_(last.bias)
    return nn.Sequential(
        nn.Linear(inputs, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, HIDDEN), nn.ReLU(), last
    )


class Agent(nn.Module):
    """Scores of the actions, and what is still to be gained."""

    def __init__(self, inputs: int) -> None:
        super().__init__()
        self.actor = dense(inputs, ACTIONS, 0.01)
        self.critic = dense(inputs, 1, 0.1)

    def value(self, seen: torch.Tensor) -> torch.Tensor:
        """The value of what some drones see: shape (n,)."""
        value: torch.Tensor = self.critic(seen)[:, 0]
        return value

    def network(self) -> Network:
        """The actor as the package runs it."""
        layers = [layer for layer in self.actor if isinstance(layer, nn.Linear)]
        return Network(
            [(layer.weight.detach().numpy().T, layer.bias.detach().numpy()) for layer in layers]
        )


class Swarms:
    """A batch of searches, stepped by scores of actions."""

    def __init__(self, seed: int, **parameters: Any) -> None:
        self.env = DroneVectorEnv(observation="crops", **parameters)
        self.batch = self.env.batch
        scenario = self.batch.scenario_of(0)
        self.size, self.drones = scenario.grid_size, scenario.n_drones
        self.detection = scenario.detections[0]
        self.seen, _ = self.env.reset(seed=seed)
        self.returns = np.zeros(self.batch.num_rows)
        self.age = 0  # steps made

    def step(
        self, scores: Singles, rng: np.random.Generator, tally: Tally
    ) -> dict[str, NDArray[Any]]:
        """Let every drone draw its action from the softmax of its scores; the transitions."""
        scores = scores.reshape(-1, self.drones, ACTIONS)
        cells = self.batch.cells
        actions, masks = choose_in_turn(scores + rng.gumbel(size=scores.shape), cells, self.size)

        chances = np.zeros(actions.shape, np.float32)
        rows, drones = (actions == Action.SEARCH).nonzero()
        shown = self.batch.probabilities(rows, cells[rows, drones])
        chances[rows, drones] = self.detection * shown

        real = ~self.batch.ended.repeat(self.drones)
        self.seen, _, over, _, _ = self.env.step(actions.reshape(-1))
        tally.count(self)
        return {
            "actions": actions.reshape(-1),
            "masks": masks.reshape(-1, ACTIONS),
            "rewards": chances.reshape(-1),
            "over": over,
            "real": real,
        }


class Tally:
    """The episodes that have ended since the last look.

    Searches begun together end in waves, the lucky ones first; the first two do not count.
    """

    def __init__(self) -> None:
        self.returns: list[float] = []
        self.found: list[bool] = []

    def count(self, swarms: Swarms) -> None:
        """Take in a step."""
        swarms.returns += swarms.batch.rewards.mean(axis=1)
        swarms.age += 1
        over = swarms.batch.ended
        if swarms.age > 2 * swarms.batch.scenario_of(0).timestep_limit:
            self.returns += swarms.returns[over].tolist()
            self.found += (swarms.batch.endings[over] == FOUND).tolist()
        swarms.returns[over] = 0.0

    def take(self) -> dict[str, float | None]:
        """The mean return of a drone and the share of searches that found the person."""
        ended = len(self.found)
        reward = sum(self.returns) / ended if ended else None
        found = sum(self.found) / ended if ended else None
        self.returns, self.found = [], []
        return {"reward": reward, "found": found}


def rollout(
    agent: Agent, family: list[Swarms], rng: np.random.Generator, tally: Tally
) -> dict[str, torch.Tensor]:
    """Fly for some steps: every transition with its advantage and its return.

    Slots whose search began anew in a step are not "real" there: nothing is to be learned.
    """
    steps: list[dict[str, NDArray[Any]]] = []
    slots = sum(swarms.env.num_envs for swarms in family)
    seen = np.empty((ROLLOUT + 1, slots, *family[0].seen.shape[1:]), np.float32)
    for now in seen[:-1]:
        np.concatenate([swarms.seen for swarms in family], out=now)
        with torch.no_grad():
            inputs = torch.from_numpy(now)
            scores, values = agent.actor(inputs), agent.value(inputs)
        first, parts = 0, []
        for swarms in family:
            last = first + swarms.env.num_envs
            parts.append(swarms.step(scores[first:last].numpy(), rng, tally))
            first = last
        joined = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
        masked = scores.masked_fill(~torch.from_numpy(joined["masks"]), -torch.inf)
        chosen = torch.from_numpy(joined["actions"])[:, None]
        logarithms = masked.log_softmax(dim=1).gather(1, chosen)[:, 0].numpy()
        steps.append({"values": values.numpy(), "logarithms": logarithms, **joined})

    np.concatenate([swarms.seen for swarms in family], out=seen[-1])
    with torch.no_grad():
        after = agent.value(torch.from_numpy(seen[-1])).numpy()
    data = {key: np.stack([step[key] for step in steps]) for key in steps[0]}
    advantages = np.zeros_like(data["values"])
    trace = np.zeros_like(after)
    for step in reversed(range(ROLLOUT)):
        # Finding the person, and the end of the time, which the drones see coming.
        goes_on = 1.0 - data["over"][step]
        surprise = data["rewards"][step] + DISCOUNT * goes_on * after - data["values"][step]
        trace = surprise + DISCOUNT * TRACE * goes_on * trace
        advantages[step], after = trace, data["values"][step]
    learned_from = {
        "seen": seen[:-1],
        "advantages": advantages,
        "returns": advantages + data["values"],
        **{key: data[key] for key in ("actions", "masks", "logarithms", "real")},
    }
    return {key: torch.from_numpy(each).flatten(0, 1) for key, each in learned_from.items()}


def update(
    agent: Agent, optimiser: torch.optim.Optimizer, data: dict[str, torch.Tensor], share: float
) -> float:
    """PPO's update, with this share of the training left; returns the policy's entropy."""
    for group in optimiser.param_groups:
        group["lr"] = LEARNING_RATE * max(share, 0.05)
    real, entropy = data["real"].nonzero()[:, 0], torch.zeros(())
    for _ in range(EPOCHS):
        for places in real[torch.randperm(len(real))].split(MINIBATCH):
            part = {key: values[places] for key, values in data.items()}
            scores = agent.actor(part["seen"]).masked_fill(~part["masks"], -1e9)
            logarithms = scores.log_softmax(dim=1)
            chosen = logarithms.gather(1, part["actions"][:, None])[:, 0]
            ratio = (chosen - part["logarithms"]).exp()
            advantages = part["advantages"]
            advantages = (advantages - advantages.mean()) / (advantages.std() + 1e-8)
            gain = torch.min(ratio * advantages, ratio.clamp(1 - CLIP, 1 + CLIP) * advantages)
            entropy = -(logarithms.exp() * logarithms).sum(dim=1).mean()
            error = (agent.value(part["seen"]) - part["returns"]).square().mean()
            loss = VALUE * error - gain.mean() - ENTROPY * share * entropy
            optimiser.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(agent.parameters(), GRADIENT)
            optimiser.step()
    return entropy.item()


def train(run: Run, seed: int) -> None:
    """Train up to the wanted number of environment steps, from the checkpoint if it resumes."""
    torch.manual_seed(seed)
    first_seed, checkpoint = seed, None
    if run.resumes:
        checkpoint = torch.load(run.checkpoint, weights_only=True)
        run.go_on_from(checkpoint["steps"])
        first_seed += checkpoint["steps"]  # other searches than before
    family = [
        Swarms(
            first_seed + 10_000_019 * number,
            sampler=sampler(**size),
            bayesian_update=True,
            **size,
            **others,
        )
        for number, (size, others) in enumerate(FAMILY)
    ]
    agent = Agent(family[0].seen.shape[1])
    optimiser = torch.optim.Adam(agent.parameters(), eps=1e-5, fused=True)
    if checkpoint is not None:
        agent.load_state_dict(checkpoint["agent"])
        optimiser.load_state_dict(checkpoint["optimiser"])
    rng, tally = np.random.default_rng(first_seed), Tally()
    a_round = ROLLOUT * sum(swarms.batch.num_rows for swarms in family)

    if checkpoint is None:
        save(run, agent, optimiser, 0)
    while run.steps_done < run.wanted:
        share = 1.0 - run.steps_done / run.wanted
        data = rollout(agent, family, rng, tally)
        entropy = update(agent, optimiser, data, share)
        steps = run.steps_done + a_round
        save(run, agent, optimiser, steps)
        run.log(steps, entropy=entropy, **tally.take())


def save(run: Run, agent: Agent, optimiser: torch.optim.Optimizer, steps: int) -> None:
    """Keep the weights, and what `--resume` needs; the latter last: it says what is done."""
    with run.saving("policy.npz") as path:
        agent.network().save(path)
    state = {"agent": agent.state_dict(), "optimiser": optimiser.state_dict(), "steps": steps}
    with run.saving("checkpoint.pt") as path:
        torch.save(state, path)


def main() -> None:
    """Train, draw the curve, compare."""
    description = "Train one network for all drones by PPO on searches drawn at random."
    options = arguments(description, steps=12_000_000, short=130_000).parse_args()
    with Run(options, "PPO, one file") as run:
        train(run, options.seed)
    unseen = search(UNSEEN)
    policy = PPOPolicy(unseen.scenario, run.folder / "policy.npz")
    print(f'\nOn the search "{UNSEEN}", which it was not trained on:\n')
    compare_with_baselines(
        policy,
        unseen.parameters,
        view="swarm",
        observation="dict",
        episodes=options.episodes,
        name="ppo",
        folder=run.folder,
    )


if __name__ == "__main__":
    main()
