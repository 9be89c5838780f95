"""Train the policy "imitation" in plain PyTorch: one network for all drones imitates plans.

    pip install "DroneSwarmSearchEnvironment[ppo]"
    python examples/train_imitation.py --out runs/imitation

This script trains networks like that of the package. It repeats four steps (expert iteration:
T. Anthony, Z. Tian, D. Barber, NIPS 2017):

- Draw random searches: grid, drones, persons, drift, probability of detection, time limit.
- Fly them with the network. The untrained one is greedy search on the forecast.
- Improve its paths as the policy "planner" does (`planning.plan`), for some searches only from a
  later step on, where sampled actions have led (DAgger: S. Ross, G. Gordon, D. Bagnell, AISTATS
  2011).
- Train the network to choose what these plans and all earlier ones do.

Where a drone flies several cells to its next search, the order of its moves does not matter, so any
move that leads closer is right. The inputs (`policies.arrivals`) have one length for all searches,
and the network scores all four directions in the same way. The weights are saved as policy.npz,
which the package runs without PyTorch:

    ImitationPolicy(env.scenario, "runs/imitation/policy.npz")
"""

from __future__ import annotations

import argparse
from functools import partial
from os.path import relpath
from pathlib import Path
from typing import Any

import numpy as np
import torch
from drawn_searches import draw_searches, held_out_searches, mean_success
from expected_searches import ExpectedSearches
from numpy.typing import NDArray
from torch import nn
from training_script import begin

from DroneSwarmSearch import Action, Scenario, training
from DroneSwarmSearch.core import choose_in_turn
from DroneSwarmSearch.core.grid import OFF_GRID, Grid
from DroneSwarmSearch.evaluation import evaluate, search
from DroneSwarmSearch.paths.best_paths import DronePath
from DroneSwarmSearch.paths.joint_plan import JointPlan
from DroneSwarmSearch.paths.passes import Target
from DroneSwarmSearch.policies.arrivals import BASELINE, INPUTS, TURNS, VIEWS
from DroneSwarmSearch.policies.belief_tracker import BeliefTracker
from DroneSwarmSearch.policies.imitation import ImitationPolicy, Network

TEST_SEARCH = "classic"
"""The search of the evaluation suite for the comparison with the baselines."""

BASELINES = ("greedy-matrix", "greedy-posterior", "greedy-forecast")
HELD_OUT = 12  # searches outside the training, to compare with the baselines

TOGETHER = 4  # searches of one size, flown together
LARGEST = 1_600_000  # drones x steps x cells of the searches to plan
LATER = 0.5  # part of the searches that are planned from a later step on
NOISE = 0.5  # factor on the Gumbel noise of the actions before
SECONDS = 0.005  # work of the planner for each drone and step
EVERY = 2  # of so many steps of a plan, one is learned from
ENOUGH = 0.99  # probability of success after which nothing is learned
HIDDEN = 128  # units in each of the two hidden layers
BASELINE_SCALE = 3.0  # of the greedy scores in the logits at the start
EPOCHS = 10
MINIBATCH_SIZE = 512
LEARNING_RATE = 1e-3  # at the start; annealed to zero
WEIGHT_DECAY = 1e-4
MAX_GRAD_NORM = 1.0
NUM_ACTIONS = len(Action) - 1  # all but idling: a search is free here and never worse

_FROM_VIEW = torch.from_numpy(np.argsort(VIEWS, axis=1))

Samples = dict[str, NDArray[Any]]
"""Inputs, allowed actions and right actions of drones: shapes (k, INPUTS), (k, 5) and (k, 5)."""


class Agent(nn.Module):
    """A perceptron that observes the inputs in four views; its last layer also sees the inputs.

    The form of `policies.imitation.Network`.
    """

    def __init__(self) -> None:
        super().__init__()
        self.first = nn.Linear(INPUTS, HIDDEN)
        self.second = nn.Linear(HIDDEN, HIDDEN)
        self.last = nn.Linear(HIDDEN + INPUTS, 2)
        nn.init.orthogonal_(self.first.weight)
        nn.init.orthogonal_(self.last.weight[:, :HIDDEN], 0.01)
        nn.init.zeros_(self.last.weight[:, HIDDEN:])
        nn.init.zeros_(self.last.bias)
        with torch.no_grad():
            for output, place in enumerate(BASELINE):
                self.last.weight[output, HIDDEN + place] = BASELINE_SCALE
                # The same with the wider view decides between equal scores.
                self.last.weight[output, HIDDEN + place + 5] = BASELINE_SCALE / 50

    def forward(self, inputs: torch.Tensor) -> torch.Tensor:
        """Logits of the actions, shape (n, INPUTS) to shape (n, NUM_ACTIONS)."""
        hidden = torch.relu(_in_views(inputs, self.first.weight) + self.first.bias)
        hidden = torch.relu(self.second(hidden))
        of_hidden, of_inputs = self.last.weight.split([HIDDEN, INPUTS], dim=1)
        outputs = hidden @ of_hidden.T + _in_views(inputs, of_inputs) + self.last.bias
        moves = outputs[:, np.argsort(TURNS), 0]
        return torch.cat([moves, outputs[:, :, 1].mean(dim=1, keepdim=True)], dim=1)

    def network(self) -> Network:
        """The same in the form that the package runs in NumPy."""
        layers = (self.first, self.second, self.last)
        return Network(
            [(layer.weight.detach().numpy().T, layer.bias.detach().numpy()) for layer in layers]
        )


def _in_views(inputs: torch.Tensor, weight: torch.Tensor) -> torch.Tensor:
    """`inputs[:, VIEWS] @ weight.T`, but the weights are turned instead of the inputs."""
    turned = weight.T[_FROM_VIEW].permute(1, 0, 2)  # [input, view, unit]
    return (inputs @ turned.reshape(INPUTS, -1)).reshape(len(inputs), len(TURNS), -1)


def draw(rng: np.random.Generator) -> tuple[list[Scenario], NDArray[np.int64]]:
    """Random searches of one size, and their start cells; small enough to plan in a second."""
    while True:
        scenarios, starts = draw_searches(rng)
        shape = scenarios[0]
        if shape.n_drones * shape.timestep_limit * shape.grid_size**2 < LARGEST:
            return scenarios[:TOGETHER], starts[:TOGETHER]


def fly(
    agent: Agent, batch: ExpectedSearches, rng: np.random.Generator, noisy: int
) -> tuple[NDArray[np.integer], NDArray[np.integer]]:
    """Fly searches with the network; `noisy` is the number of steps with sampled actions.

    Returns the drones' cells, shape (steps + 1, searches, n), and actions, (steps, searches, n).
    """
    cells = [batch.cells]
    chosen = []
    while batch.step < batch.timestep_limit:
        with torch.no_grad():
            logits = agent(torch.from_numpy(batch.inputs().reshape(-1, INPUTS))).numpy()
        if batch.step < noisy:
            logits += NOISE * rng.gumbel(size=logits.shape).astype(np.float32)
        scores = logits.reshape(*batch.cells.shape, NUM_ACTIONS)
        actions, _ = choose_in_turn(scores, batch.cells, batch.grid_size)
        batch.advance(actions)
        cells.append(batch.cells)
        chosen.append(actions)
    return np.array(cells), np.array(chosen)


def improve(
    scenario: Scenario,
    cells: NDArray[np.integer],
    actions: NDArray[np.integer],
    first: int,
    rng: np.random.Generator,
) -> tuple[NDArray[np.integer], NDArray[np.integer]]:
    """Improve the drones' paths in a search, by cells and actions as of `fly`, from a step on."""
    tracker = BeliefTracker(scenario)
    size = scenario.grid_size
    for here, now in zip(cells[:first], actions[:first], strict=False):
        tracker.update([(int(cell % size), int(cell // size)) for cell in here], now.tolist())
    persons = zip(tracker.missing, tracker.forecasts, scenario.detections, strict=True)
    worth = np.ones(len(actions) - first)
    targets = [
        Target(forecast, detection, tracker.joint(person), worth)
        for person, forecast, detection in persons
    ]
    searches = (actions[first:] == Action.SEARCH).T
    plan = JointPlan(targets, first, [*map(DronePath, cells[first:].T, searches)])
    plan.anneal(SECONDS * searches.size, rng)
    cells = cells.copy()
    actions = actions.copy()
    cells[first:] = np.transpose([path.cells for path in plan.paths])
    here = cells[first:-1]
    there = cells[first + 1 :]
    moves = Grid.of(size).targets[here, : Action.SEARCH] == there[..., None]
    actions[first:] = np.where(here == there, Action.SEARCH, moves.argmax(axis=-1))
    return cells, actions


def right_actions(cells: NDArray[np.integer], actions: NDArray[np.integer], size: int) -> Any:
    """The actions as good as a drone's own ones: bool, shape (steps, NUM_ACTIONS).

    Before its next search, all moves that lead closer are, and after the last one, none.
    """
    right = np.zeros((len(actions), NUM_ACTIONS), np.bool_)
    goal = None
    neighbours = Grid.of(size).targets

    def distance(cell: int, goal: int) -> int:
        return abs(cell % size - goal % size) + abs(cell // size - goal // size)

    for step in reversed(range(len(actions))):
        here, there = map(int, cells[step : step + 2])
        if actions[step] == Action.SEARCH:
            goal = here
            right[step, Action.SEARCH] = True
        elif goal is not None:
            right[step, actions[step]] = True
            if distance(there, goal) < distance(here, goal):
                for move in TURNS:
                    ahead = int(neighbours[here, move])
                    closer = ahead != OFF_GRID and distance(ahead, goal) < distance(here, goal)
                    right[step, move] |= closer
    return right


def watch(
    batch: ExpectedSearches,
    cells: NDArray[np.integer],
    actions: NDArray[np.integer],
    first: int,
    offset: int,
) -> Samples:
    """What the drones observe and do in searches with given paths, from a step on."""
    size = batch.grid_size
    parts = []
    right = np.zeros((*actions.shape, NUM_ACTIONS), np.bool_)
    for swarm, drone in np.ndindex(actions.shape[1:]):
        right[:, swarm, drone] = right_actions(
            cells[:, swarm, drone], actions[:, swarm, drone], size
        )
    for step, now in enumerate(actions):
        if step >= first and step % EVERY == offset:
            scores = np.eye(NUM_ACTIONS)[now]
            taken, allowed = choose_in_turn(scores, batch.cells, size)
            good = right[step] & allowed
            # Plans may exchange the cells of two drones, which choosing in turn does not.
            use = (taken == now) & good.any(axis=-1) & (batch.found < ENOUGH)[:, None]
            part = {"inputs": batch.inputs().astype(np.float16), "allowed": allowed, "right": good}
            parts.append({key: each[use] for key, each in part.items()})
        batch.advance(now)
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]} if parts else {}


def learn(agent: Agent, samples: Samples) -> float:
    """Train on all samples; returns the mean loss of the last epoch."""
    optimizer = torch.optim.AdamW(agent.parameters(), LEARNING_RATE, weight_decay=WEIGHT_DECAY)
    data = {key: torch.from_numpy(each) for key, each in samples.items()}
    count = len(data["inputs"])
    steps = EPOCHS * -(-count // MINIBATCH_SIZE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
    for _ in range(EPOCHS):
        losses = []
        for mb_inds in torch.randperm(count).split(MINIBATCH_SIZE):
            mb = {key: each[mb_inds] for key, each in data.items()}
            logits = agent(mb["inputs"].float()).masked_fill(~mb["allowed"], -1e9)
            logprobs = logits.log_softmax(dim=1).masked_fill(~mb["right"], -1e9)
            loss = -logprobs.logsumexp(dim=1).mean()
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(agent.parameters(), MAX_GRAD_NORM)
            optimizer.step()
            schedule.step()
            losses.append(loss.item())
    return float(np.mean(losses))


def plan_searches(
    agent: Agent, count: int, rng: np.random.Generator
) -> tuple[list[Samples], float, float]:
    """Fly, improve and watch about as many random searches as `count`.

    Returns the samples, and the mean success of the network and of the improved paths.
    """
    samples = []
    flown = []
    planned = []
    for _ in range(max(count // TOGETHER, 1)):
        scenarios, starts = draw(rng)
        limit = scenarios[0].timestep_limit
        first = int(rng.integers(1, limit * 2 // 3)) if rng.random() < LATER else 0
        batch = ExpectedSearches(scenarios, starts)
        cells, actions = fly(agent, batch, rng, first)
        flown.append(batch.found.mean())
        for number, scenario in enumerate(scenarios):
            paths = cells[:, number], actions[:, number], first
            cells[:, number], actions[:, number] = improve(scenario, *paths, rng)
        batch = ExpectedSearches(scenarios, starts)
        samples.append(watch(batch, cells, actions, first, int(rng.integers(EVERY))))
        planned.append(batch.found.mean())
    return [each for each in samples if each], float(np.mean(flown)), float(np.mean(planned))


def train(options: argparse.Namespace) -> Path:
    """Plan and learn in all rounds; returns the path of the weights."""
    curve = options.out / "curve.csv"
    weights = options.out / "policy.npz"
    torch.manual_seed(options.seed)
    rng = np.random.default_rng(options.seed)
    parts = []
    searches = 0
    agent = Agent()
    held_out = held_out_searches(HELD_OUT)
    for _ in range(options.rounds):
        agent.network().save(weights)
        alone = partial(ImitationPolicy, weights=weights, samples=None)
        row = {"held-out": mean_success(alone, held_out)}
        more, flown, planned = plan_searches(agent, options.searches, rng)
        training.log_row(curve, searches=searches, flown=flown, planned=planned, **row)
        searches = searches + options.searches
        parts = [*parts, *more]
        agent = Agent()
        learn(agent, {key: np.concatenate([each[key] for each in parts]) for key in parts[0]})
    agent.network().save(weights)
    row = {"held-out": mean_success(alone, held_out)}
    training.log_row(curve, searches=searches, flown=np.nan, planned=np.nan, **row)
    baselines = [evaluate(name, each, episodes=1) for name in BASELINES for each in held_out]
    training.plot_curve(curve, steps="searches", columns=["held-out"], baselines=baselines)
    return weights


def main() -> None:
    options = begin(
        'Train the policy "imitation" on random searches.',
        rounds={"type": int, "default": 3, "help": "of planning and learning"},
        searches={"type": int, "default": 400, "help": "to plan in each round"},
    )
    torch.set_num_threads(options.threads)
    weights = train(options)
    print(f'\nOn the search "{TEST_SEARCH}", which is not part of the training:\n')
    training.compare_with_baselines(
        f"{relpath(__file__)}:ImitationPolicy:{weights}",
        search(TEST_SEARCH).parameters,
        episodes=options.episodes,
        name="imitation",
        folder=options.out,
    )


if __name__ == "__main__":
    main()
