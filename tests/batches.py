"""What the tests of batches share: names of parameters, a sampler, and a record of a batch."""

from __future__ import annotations

from typing import Any

import numpy as np
from helpers import plain

from DroneSwarmSearch._internal.streams import RowGenerator
from DroneSwarmSearch.vector import SearchBatch

NAN, INF = float("nan"), float("inf")
PERSON = "person_initial_position"
POD = "probability_of_detection"
DRONES = "drones_positions"
CONSTANT = "disperse_constant"

# The axes of a value for all rows; with one axis more, each row has its own.
AXES = {"vector": 1, PERSON: 2, CONSTANT: 0, DRONES: 2}
SITUATION_AXES = {"situation": 0, DRONES: 2}


def moved(cell: int, number: float, higher: np.ndarray, lower: np.ndarray) -> int:
    if number < higher[cell]:
        return cell + 1
    return cell - 1 if number < higher[cell] + lower[cell] else cell


def seen(batch: SearchBatch) -> list[Any]:
    """All that can be seen of every row, the parameters included."""
    matrices = batch.matrices_of(np.arange(batch.num_rows))
    values = [
        batch.rewards, batch.endings, batch.found, batch.ended, batch.steps, batch.cells,
        batch.searching, batch.missing, batch.person_cells, matrices, *batch.parameters.values(),
    ]  # fmt: skip
    return [[plain(value[row]) for value in values] for row in range(batch.num_rows)]


def everything_sampled(rng: RowGenerator) -> dict[str, Any]:
    """Two drones in different halves of a grid of 6 x 6, one person anywhere."""
    return {
        "vector": rng.uniform(-1, 1, 2),
        PERSON: rng.integers(0, 6, (1, 2)),
        CONSTANT: rng.uniform(0, 30),
        DRONES: rng.integers([[0, 0], [3, 0]], [[3, 6], [6, 6]], (2, 2)),
    }


SAMPLED = {
    "grid_size": 6,
    "n_drones": 2,
    "timestep_limit": 12,
    POD: 0.5,
    "bayesian_update": True,
}
