"""A network of one's own, evaluated beside the policies of the package on the same seas.

    python examples/evaluate_your_own.py --search harbour --episodes 500

The network here is two linear layers with weights set by hand, one copy for every drone; a
trained one takes its place without further changes. It has no memory, so everybody is
shown the posterior, which remembers the searches. The command line takes it, too, as
`examples/evaluate_your_own.py:ScentNetwork`, with the options `--view drone --observation
planes --posterior`.
"""

from __future__ import annotations

import argparse

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch import Action
from DroneSwarmSearch.evaluation import Evaluation, compare, evaluate
from DroneSwarmSearch.scenario import Scenario

RIVALS = ("random", "parallel-sweep", "greedy-matrix", "greedy-posterior")
"""The policies that it is compared with; the planner takes some seconds more."""

REACH = 0.7
"""What is left of a cell's scent with every step away from it."""

LEAST = 0.3
"""Of the likeliest cell's probability: a drone searches a cell that has more."""

EAGERNESS = 1000.0
"""The weight of searching against moving on."""

CLOSED = -1.0
"""The scent where a drone must not go: off the grid, and where another may be next."""

AHEAD = {Action.LEFT: (-1, 0), Action.RIGHT: (1, 0), Action.UP: (0, -1), Action.DOWN: (0, 1)}

Singles = NDArray[np.float32]


class ScentNetwork:
    """Follows the scent of likely cells, and searches where it is strong enough.

    The first layer spreads the matrix over the grid. The second reads it around the drone:
    a score for each of the four moves, and one for searching. The greatest is the action.
    """

    def __init__(self, scenario: Scenario) -> None:
        cells = np.arange(scenario.grid_size)
        self.spreading = (REACH ** np.abs(cells[:, None] - cells)).astype(np.float32)

    def __call__(self, seen: Singles) -> NDArray[np.int64]:
        """Actions, shape (drones,), for planes (drones, 4, N, N): matrix, itself, others, time."""
        matrix, own, others, _ = seen.transpose(1, 0, 2, 3)
        drones = np.arange(len(own))
        y, x = np.divmod(own.reshape(len(own), -1).argmax(axis=1), own.shape[-1])

        scent = self.spreading @ matrix @ self.spreading
        scent[_within_a_step(others)] = CLOSED
        around = np.pad(scent, ((0, 0), (1, 1), (1, 1)), constant_values=CLOSED)
        moving = [around[drones, y + 1 + dy, x + 1 + dx] for dx, dy in AHEAD.values()]
        searching = EAGERNESS * np.maximum(matrix[drones, y, x] - LEAST, 0.0)
        actions: NDArray[np.int64] = np.stack([*moving, searching], axis=1).argmax(axis=1)
        return actions


def _within_a_step(planes: Singles) -> NDArray[np.bool_]:
    """The cells that are marked in some planes, and those next to them."""
    marked = planes > 0.0
    near = marked.copy()
    near[:, 1:] |= marked[:, :-1]
    near[:, :-1] |= marked[:, 1:]
    near[:, :, 1:] |= marked[:, :, :-1]
    near[:, :, :-1] |= marked[:, :, 1:]
    return near


def figures(each: Evaluation) -> str:
    """The share of successes with its interval, and the mean time to find."""
    success = each.success
    return (
        f"{each.policy:>16}: found {success.value:6.1%} ({success.low:.1%} to {success.high:.1%}), "
        f"in {each.time.value:.1f} steps"
    )


def main() -> None:
    """Evaluate the network and its rivals."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--search", default="harbour", help="a search of the suite (harbour)")
    parser.add_argument("--episodes", type=int, default=500, help="of each policy (500)")
    parser.add_argument("--workers", type=int, default=1, help="processes (1)")
    options = parser.parse_args()
    usual = {
        "episodes": options.episodes,
        "workers": options.workers,
        "bayesian_update": True,
    }

    mine = evaluate(ScentNetwork, options.search, view="drone", observation="planes", **usual)
    print(figures(mine))
    for name in RIVALS:
        rival = evaluate(name, options.search, **usual)
        more, low, high = compare(mine, rival).success.scaled(100.0)
        print(f"{figures(rival)}; network ahead by {more:+.1f} ({low:+.1f} to {high:+.1f}) points")


if __name__ == "__main__":
    main()
