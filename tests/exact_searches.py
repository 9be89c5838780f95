"""Searches whose success is exact, and a policy that records what it sees: shared by tests."""

from typing import Any

import numpy as np

from DroneSwarmSearch import Drift, Person, Scenario
from DroneSwarmSearch.drift import ProbabilityMatrix
from DroneSwarmSearch.evaluation import (
    NamedSearch,
)

LINE = np.zeros((6, 6))


LINE[4, 1:5] = 1


PERSONS = {
    "known": Person(Drift((2, 3), vector=(0.2, -0.1), diffusion=0.3)),
    "missed": Person(Drift((4, 1), vector=(-0.1, 0.3), diffusion=0.2), 0.4),
    "hypotheses": Person(
        [
            Drift((1, 1), start_sd=0.6, vector=(0.3, 0.1), vector_sd=0.05, diffusion=0.1),
            Drift(LINE, vector=(0.1, -0.2), diffusion=0.2, weight=2),
        ],
        0.8,
    ),
}


def named(*persons: str, drones: Any = ((1, 3), (4, 2)), **changes: Any) -> NamedSearch:
    """A small search for some of `PERSONS`."""
    changes = {"timestep_limit": 14, **changes}
    scenario = Scenario(6, n_drones=len(drones), persons=[PERSONS[p] for p in persons], **changes)
    return NamedSearch("small", "For tests.", scenario, drones)


def dense(forecast: ProbabilityMatrix, step: int) -> np.ndarray:
    """The transition matrices of a step over cells, [hypothesis, from, to]."""
    matrices = []
    for right, left, down, up in zip(*forecast.moves(step), strict=True):
        along = [
            np.diag(1 - higher - lower) + np.diag(higher[:-1], 1) + np.diag(lower[1:], -1)
            for higher, lower in ((right, left), (down, up))
        ]
        matrices.append(np.kron(along[1], along[0]))  # cells are y * N + x
    return np.array(matrices)


def curve_of(search: NamedSearch, actions: list[list[int]]) -> np.ndarray:
    """The success of recorded actions, one person."""
    forecast = search.scenario.forecasts()[0]
    kept = 1 - search.scenario.detections[0]
    mass = forecast.joint(0).reshape(-1, search.scenario.grid_size**2)
    cells = [x + y * search.scenario.grid_size for x, y in search.drones]
    moves = {0: -1, 1: 1, 2: -search.scenario.grid_size, 3: search.scenario.grid_size}
    success = [0.0]
    for step, chosen in enumerate(actions):
        searched = {cell for cell, action in zip(cells, chosen, strict=True) if action == 4}
        mass[:, [*searched]] *= kept
        mass = np.einsum("mi,mij->mj", mass, dense(forecast, step))
        success.append(1 - mass.sum())
        cells = [cell + moves.get(action, 0) for cell, action in zip(cells, chosen, strict=True)]
    ended = search.scenario.timestep_limit + 1 - len(success)
    return np.array([*success, *success[-1:] * ended])


class Recorder:
    """A policy that notes what it sees and does in each search."""

    def __init__(self, policy: Any) -> None:
        self.policy = policy
        self.histories: list[list[Any]] = []
        self.actions: list[list[Any]] = []

    def reset(self, seed: Any = None, rows: Any = None) -> None:
        self.policy.reset(seed=seed)
        self.histories += [[] for _ in np.atleast_1d(seed)]
        self.actions += [[] for _ in np.atleast_1d(seed)]

    def __call__(self, shown: Any) -> Any:
        chosen = self.policy(shown)
        if "row" not in shown:  # the view "parallel"
            self.actions[-1].append([*chosen.values()])
            return chosen
        for place, row in enumerate(shown["row"].tolist()):
            cells = tuple(map(tuple, shown["positions"][place].tolist()))
            matrix = shown["probability_matrix"][place].tobytes()
            self.histories[row].append((cells, matrix))
            self.actions[row].append(chosen[place].tolist())
        return chosen
