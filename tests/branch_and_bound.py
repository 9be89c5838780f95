"""The optimum of a small search, by branch and bound: the tests' oracle.

A depth-first search over all paths of all drones. It abandons a partial plan if even an optimistic
completion, in which searches do not reduce each other's gains, cannot beat the best plan so far
(J. N. Eagle and J. R. Yee, Operations Research 38:110, 1990). It extends only one of several
partial plans that lead to the same situation.
"""

from itertools import product

import numpy as np

from DroneSwarmSearch import Action
from DroneSwarmSearch.core import OFF_GRID, Grid
from DroneSwarmSearch.evaluation import NamedSearch
from DroneSwarmSearch.paths.best_paths import values_to_go


def best_success(of: NamedSearch) -> float:
    """The largest probability of success that any policy can reach by the time limit.

    Args:
        of: a search for one person: about ten steps with one drone, or six with two.
    """
    scenario = of.scenario
    (forecast,) = scenario.forecasts()
    (detection,) = scenario.detections
    limit = scenario.timestep_limit
    targets = Grid.of(scenario.grid_size).targets
    visited = set()
    best = 0.0

    def branch(step: int, cells: list[int], mass: np.ndarray, found: float) -> None:
        nonlocal best
        best = max(best, found)
        situation = step, tuple(sorted(cells)), mass.round(13).tobytes()
        if step == limit or situation in visited:
            return
        visited.add(situation)
        later = [mass]
        for ahead in range(step, limit - 1):
            later.append(forecast.forward(later[-1], ahead))
        gains = detection * np.array([each.sum(axis=0) for each in later])
        values = values_to_go(gains, np.zeros_like(gains[0]))[0].reshape(len(gains) + 1, -1)
        branches = []
        for actions in product(
            [action for action in Action if action != Action.IDLE], repeat=len(cells)
        ):
            ahead = [
                int(targets[cell, action]) for cell, action in zip(cells, actions, strict=True)
            ]
            if OFF_GRID in ahead or len({*ahead}) < len(ahead):
                continue
            searched = [c for c, a in zip(cells, actions, strict=True) if a == Action.SEARCH]
            optimistic = gains[0].reshape(-1)[searched].sum() + values[1][ahead].sum()
            branches.append((float(optimistic), ahead, searched))
        for optimistic, ahead, searched in sorted(branches, reverse=True):
            if found + optimistic <= best + 1e-12:
                break
            left = mass.copy()
            left.reshape(len(mass), -1)[:, searched] *= 1.0 - detection
            success = float(mass.sum() - left.sum())
            branch(step + 1, ahead, forecast.forward(left, step), found + success)

    branch(0, scenario.drone_cells(of.drones), forecast.joint(0), 0.0)
    return best
