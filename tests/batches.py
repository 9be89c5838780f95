"""What the tests of batches share: names of parameters, a sampler, and a record of a batch."""

from typing import Any

import numpy as np
from helpers import plain

from DroneSwarmSearch import Drift, Person
from DroneSwarmSearch.vector import SearchBatch

NAN = float("nan")
INF = float("inf")
PERSON = "person_initial_position"
POD = "probability_of_detection"
DRONES = "drones_positions"
CONSTANT = "disperse_constant"

# The axes of a value for all rows; with one axis more, each row has its own.
AXES = {"situation": 0, DRONES: 2}


PRIOR = np.diag(np.arange(6, dtype=float))
CATALOGUE = [
    [Person([Drift((1.5, 2), start_sd=1, vector_sd=0.1), Drift((4, 4), diffusion=0.3, weight=2)])],
    [Person(Drift((2, 2), vector=(0.3, 0.1), adrift=4, diffusion=0.2), 0.5)],
    [Person([Drift(PRIOR, diffusion=0.2), Drift((4, 1), vector=(-0.1, 0.1))], 0.7)],
]
"""Three situations on 6 x 6 cells."""


def seen(batch: SearchBatch) -> list[Any]:
    """All that can be seen of every row, the parameters included."""
    matrices = batch.matrices_of(np.arange(batch.num_rows))
    values = [
        batch.rewards, batch.endings, batch.found, batch.ended, batch.steps, batch.cells,
        batch.searching, batch.missing, batch.person_cells, matrices,
    ]  # fmt: skip
    if batch.probability_of_success is not None:
        values.append(batch.probability_of_success)
    values.append(batch.situation)
    return [[plain(value[row]) for value in values] for row in range(batch.num_rows)]


def everything_sampled(rng: np.random.Generator) -> dict[str, Any]:
    """Two drones in different halves of a grid of 6 x 6, one person anywhere."""
    return {
        "vector": rng.uniform(-1, 1, 2),
        PERSON: rng.integers(0, 6, 2),
        CONSTANT: rng.uniform(0, 30),
        DRONES: rng.integers([[0, 0], [3, 0]], [[3, 6], [6, 6]]),
    }


SAMPLED = {
    "grid_size": 6,
    "n_drones": 2,
    "timestep_limit": 12,
    "probability_of_detection": 0.5,
    "bayesian_update": True,
}
