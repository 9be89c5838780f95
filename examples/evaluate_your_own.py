"""Evaluate your own network, and compare it with the package's policies.

    python examples/evaluate_your_own.py --search harbour --episodes 500

The network has two linear layers with weights set by hand; one copy runs per drone. Put your
trained network in its place. It has no memory, so all policies get the posterior, which contains
the result of every search. It draws no random numbers, so its success is exact. On the command
line, the same network is `examples/evaluate_your_own.py:ScentNetwork` with the option
`--deterministic`; its attribute `view` states what it sees.
"""

from __future__ import annotations

import argparse

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch import Action, Scenario
from DroneSwarmSearch.evaluation import Evaluation, View, compare, evaluate

BASELINES = ("random", "parallel-sweep", "greedy-matrix", "greedy-posterior")

DECAY = 0.7  # of a cell's scent, per step of distance
SEARCH_THRESHOLD = 0.3  # search a cell with more than this share of the highest probability
SEARCH_WEIGHT = 1000.0  # of searching against moving
CLOSED = -1.0  # the scent off the grid, and where another drone may be next

MOVES = {Action.LEFT: (-1, 0), Action.RIGHT: (1, 0), Action.UP: (0, -1), Action.DOWN: (0, 1)}

Floats = NDArray[np.float32]


class ScentNetwork:
    """Follow the scent of likely cells, and search where the probability is high.

    The first layer spreads the matrix over the grid. The second layer scores the four moves by
    the scent around the drone, and searching by the probability below it.
    """

    view = View("drone", "planes", bayesian_update=True)

    def __init__(self, scenario: Scenario) -> None:
        cells = np.arange(scenario.grid_size)
        self.spread = (DECAY ** np.abs(cells[:, None] - cells)).astype(np.float32)

    def __call__(self, planes: Floats) -> NDArray[np.int64]:
        """Actions, shape (drones,), for planes (drones, 4, N, N): matrix, own, others, time."""
        matrix, own, others, _ = planes.transpose(1, 0, 2, 3)
        drones = np.arange(len(own))
        y, x = np.divmod(own.reshape(len(own), -1).argmax(axis=1), own.shape[-1])

        scent = self.spread @ matrix @ self.spread
        scent[within_one_step(others)] = CLOSED
        padded = np.pad(scent, ((0, 0), (1, 1), (1, 1)), constant_values=CLOSED)
        moves = [padded[drones, y + 1 + dy, x + 1 + dx] for dx, dy in MOVES.values()]
        search = SEARCH_WEIGHT * np.maximum(matrix[drones, y, x] - SEARCH_THRESHOLD, 0.0)
        actions: NDArray[np.int64] = np.stack([*moves, search], axis=1).argmax(axis=1)
        return actions


def within_one_step(planes: Floats) -> NDArray[np.bool_]:
    """The marked cells and their neighbours."""
    marked = planes > 0.0
    near = marked.copy()
    near[:, 1:] |= marked[:, :-1]
    near[:, :-1] |= marked[:, 1:]
    near[:, :, 1:] |= marked[:, :, :-1]
    near[:, :, :-1] |= marked[:, :, 1:]
    return near


def summary(result: Evaluation) -> str:
    success = result.success
    interval = "exact" if success.is_exact else f"{success.low:.1%} to {success.high:.1%}"
    return (
        f"{result.policy:>16}: found {success.value:6.1%} ({interval}), "
        f"in {result.time.value:.1f} steps"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--search", default="harbour", help="a search of the suite (harbour)")
    parser.add_argument("--episodes", type=int, default=500, help="per policy (500)")
    parser.add_argument("--workers", type=int, default=1, help="processes (1)")
    options = parser.parse_args()
    shared = {"episodes": options.episodes, "workers": options.workers}
    network = evaluate(ScentNetwork, options.search, deterministic=True, **shared)
    print(summary(network))
    for name in BASELINES:
        baseline = evaluate(name, options.search, view=View(bayesian_update=True), **shared)
        lead = compare(network, baseline).success.scaled(100.0)
        interval = "" if lead.is_exact else f" ({lead.low:+.1f} to {lead.high:+.1f})"
        print(f"{summary(baseline)}; network's lead {lead.value:+.1f}{interval} points")


if __name__ == "__main__":
    main()
