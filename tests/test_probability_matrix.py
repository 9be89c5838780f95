"""The forecast compared with a plain implementation of its formulas."""

import copy
import math
import pickle
import tracemalloc

import numpy as np
import pytest

from DroneSwarmSearch import Action, DroneSwarmSearch
from DroneSwarmSearch.drift import ProbabilityMatrix
from DroneSwarmSearch.drift import probability_matrix as module
from DroneSwarmSearch.persons import Drift, Person

VECTORS = [(0, 0), (0.3, -0.2), (3.5, -0.5), (-1e300, 7)]
DIFFUSIONS = [0, 0.06, 2 / 3]
UNCERTAINTIES: list[dict] = [
    {},
    {"start_sd": 1.5},
    {"vector_sd": (0.1, 0.0)},
    {"start_sd": (0.4, 0.0), "adrift": 3},
    {"start": (-3.25, 14.5), "start_sd": 2, "vector_sd": 0.02, "adrift": 10},
    {"vector": {0: (0.4, 0), 30: (-0.5, 0.2)}},
    {"vector": [(0.4, 0.1), (3, -0.2), (-0.6, 0)], "start_sd": 1, "adrift": 20},
    {"vector": {0: (0, 0.3), 50: (0.4, 0)}, "vector_sd": [(0.1, 0)] * 30 + [(-0.1, 0.2)] * 40},
]


def displacement(rates: np.ndarray, tau: int) -> float:
    return math.fsum(rates[min(step, len(rates) - 1)] for step in range(tau))


def plain_cdfs(size: int, drift: Drift, axis: int, steps: int) -> np.ndarray:
    """F_0 ... F_steps of one axis, cell by cell."""
    start = drift.start[axis]
    start_sd = drift.start_sd[axis]
    velocity, velocity_sd = (
        np.atleast_2d(rates)[:, axis] for rates in (drift.vector, drift.vector_sd)
    )
    diffusion = drift.diffusion
    adrift = drift.adrift
    rows: list[list[float]] = []
    for t in range(steps + 1):
        tau = adrift + t
        mean = min(max(start + displacement(velocity, tau), 0), size - 1)
        by_drift = displacement(velocity_sd, tau)
        deviation = math.sqrt(start_sd**2 + diffusion * tau + by_drift**2)

        def phi(edge: float, mean: float = mean, deviation: float = deviation) -> float:
            if deviation == 0:
                return 1.0 if edge - 0.5 >= math.floor(mean + 0.5) else 0.0
            return 0.5 * (1 + math.erf((edge - mean) / (deviation * math.sqrt(2))))

        total = phi(size - 0.5) - phi(-0.5) if deviation else 1.0
        below = phi(-0.5) if deviation else 0.0
        row = [(phi(x + 0.5) - below) / total for x in range(size)]
        if rows:
            before = [0.0, *rows[-1], 1.0]
            row = [min(max(row[x], before[x]), before[x + 2]) for x in range(size)]
        rows.append(row)
    return np.array(rows)


def separable_drifts() -> list[Drift]:
    """All vectors and diffusions with a known start, and all kinds of uncertainty."""
    known = [
        Drift((4, 9), vector=vector, diffusion=diffusion)
        for vector in VECTORS
        for diffusion in DIFFUSIONS
    ]
    uncertain = [
        Drift(**{"start": (4, 9), "vector": (0.3, -0.2), "diffusion": 0.1, **values})
        for values in UNCERTAINTIES
    ]
    return known + uncertain


@pytest.mark.parametrize("drift", separable_drifts())
def test_forecast_is_the_clipped_gaussian(drift):
    size = 11
    steps = 70
    forecast = ProbabilityMatrix(size, drift)
    columns, rows = (np.diff(plain_cdfs(size, drift, axis, steps), prepend=0.0) for axis in (0, 1))
    for t in range(steps + 1):
        x, y = forecast.marginals(t)
        np.testing.assert_allclose(x, columns[t], atol=1e-12)
        np.testing.assert_allclose(y, rows[t], atol=1e-12)
        np.testing.assert_allclose(forecast.at(t), np.outer(rows[t], columns[t]), atol=1e-7)


def prior(size: int, seed: int = 0) -> np.ndarray:
    """A map with empty cells."""
    numbers = np.random.default_rng(seed).random((size, size))
    return np.where(numbers > 0.7, numbers, 0.0)


MIXTURE = Person(
    [
        Drift((2, 3), start_sd=1, vector=(0.2, 0.1), vector_sd=0.05, diffusion=0.1, weight=3),
        Drift((8, 8), vector=(-0.4, 0), diffusion=0.4),
        Drift(prior(11), vector=(0.1, -0.3), vector_sd=0.02, diffusion=0.2, weight=0.5),
        Drift(prior(11), vector={0: (0.3, 0.1), 40: (-0.3, 0)}, diffusion=0.2, weight=0.5),
    ]
)
PERSONS = [*map(Person, separable_drifts()), MIXTURE, Person(MIXTURE.drift.drifts[2])]


@pytest.mark.parametrize("person", PERSONS)
def test_moves_map_each_forecast_to_the_next(person):
    forecast = ProbabilityMatrix(11, person.drift)
    cells = np.arange(11)
    for t in range(100):
        right, left, down, up = forecast.moves(t)
        moved = np.zeros((len(person.drift.drifts), 11, 11))
        for h, joint in enumerate(forecast.joint(t)):
            along = []
            for higher, lower in ((right[h], left[h]), (down[h], up[h])):
                stay = 1 - higher - lower
                assert min(higher.min(), lower.min(), stay.min()) >= -1e-12
                assert higher[-1] == 0.0 == lower[0]
                matrix = np.zeros((11, 11))
                matrix[cells, cells] = stay
                matrix[cells[:-1], cells[1:]] = higher[:-1]
                matrix[cells[1:], cells[:-1]] = lower[1:]
                along.append(matrix)
            moved[h] = along[1].T @ joint @ along[0]
        np.testing.assert_allclose(moved, forecast.joint(t + 1), atol=1e-13)
        assert forecast.exact(t).sum() == pytest.approx(1)


def test_a_mixture_is_the_weighted_mean_of_its_hypotheses():
    forecast = ProbabilityMatrix(11, MIXTURE.drift)
    parts = [ProbabilityMatrix(11, drift) for drift in MIXTURE.drift.drifts]
    for t in (0, 1, 90):
        expected = sum(w * p.exact(t) for w, p in zip(MIXTURE.drift.weights, parts, strict=True))
        np.testing.assert_allclose(forecast.exact(t), expected, atol=1e-13)
        np.testing.assert_allclose(forecast.at(t), expected, atol=1e-6)
        for axis, marginal in enumerate(forecast.marginals(t)):
            np.testing.assert_allclose(marginal, expected.sum(axis=axis), atol=1e-13)


def test_a_start_given_as_an_array():
    """An array with one cell equals the cell; separate cells equal a mixture of cells."""
    values: dict = {"vector": (0.2, -0.1), "vector_sd": 0.03, "diffusion": 0.2}
    one = np.zeros((11, 11))
    one[9, 4] = 7.0
    as_array, as_cell = (ProbabilityMatrix(11, Drift(start, **values)) for start in (one, (4, 9)))
    for t in range(60):
        np.testing.assert_allclose(as_array.exact(t), as_cell.exact(t), atol=1e-12)
    two = np.zeros((41, 41))
    two[10, 10] = 3.0
    two[30, 30] = 1.0
    still: dict = {"diffusion": 0.2}
    mixture = Person([Drift((10, 10), weight=3, **still), Drift((30, 30), weight=1, **still)])
    as_array, as_mixture = (
        ProbabilityMatrix(41, person) for person in (Drift(two, **still), mixture)
    )
    np.testing.assert_array_equal(as_array.exact(0), two / 4)
    for t in range(60):
        distance = np.abs(as_array.exact(t) - as_mixture.exact(t)).sum() / 2
        assert distance < 0.01


def covariance(drift: Drift, first: int, last: int, size: int = 81) -> float:
    """Of a person's x at two steps, by the moves along x."""
    forecast = ProbabilityMatrix(size, drift)
    cells = np.arange(size)
    later = cells.astype(float)  # the expected x at the last step, given x at the first
    for t in reversed(range(first, last)):
        (right,), (left,), _, _ = forecast.moves(t)
        later = (
            (1 - right - left) * later
            + right * np.append(later[1:], 0.0)
            + left * np.append(0.0, later[:-1])
        )
    x, _ = forecast.marginals(first)
    return float(x @ (cells * later) - (x @ cells) * (x @ later))


@pytest.mark.parametrize(
    ("diffusion", "velocity", "uncertainty", "low", "high"),
    [
        (1 / 9, 0.1, {}, 0.95, 1.12),
        (0.25, 0.5, {}, 0.95, 1.05),
        (0.444, 0.3, {}, 0.95, 1.1),
        (0.05, 0.1, {"vector_sd": (0.05, 0), "start_sd": 2}, 0.9, 1.1),
        # The lattice is the limit: steps of whole cells vary more than this diffusion.
        (0.015, 0.05, {}, 0.4, 0.6),
    ],
)
def test_a_person_remembers_as_a_brownian_motion_does(diffusion, velocity, uncertainty, low, high):
    drift = Drift((40, 40), vector=(velocity, 0), diffusion=diffusion, **uncertainty)
    # type: ignore[misc]
    start_sd, _ = drift.start_sd
    velocity_sd, _ = drift.vector_sd
    expected = start_sd**2 + 20 * diffusion + 20 * 60 * velocity_sd**2
    assert low < covariance(drift, 20, 60) / expected < high


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ((1, Drift((0, 0))), ValueError, "grid_size must be an integer of at least 2, got 1"),
        ((5, Drift((9, 9))), ValueError, r"start.* 0 to 4 .* got .*9, 9"),
        ((5, (1, 1)), TypeError, r"drifts\[0\] must be a Drift, got 1"),
    ],
)
def test_bad_arguments(arguments, error, message):
    with pytest.raises(error, match=message):
        ProbabilityMatrix(*arguments)


def test_the_memory_of_a_long_episode_stops_growing_at_the_limit(monkeypatch):
    monkeypatch.setattr(module, "CACHE_BYTES", 4 * 2**20)
    scenario = {"timestep_limit": 10**9, "bayesian_update": True}
    env = DroneSwarmSearch(40, person_initial_position=(20, 20), **scenario)
    env.reset(seed=0)
    env.step({"drone0": Action.SEARCH})
    tracemalloc.start()
    used = []
    for _ in range(4):
        for _ in range(400):
            env.step({"drone0": Action.IDLE})
        used.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert used[0] < 8 * 2**20
    assert used[-1] - used[1] < 2**20


def test_matrices_are_new_arrays():
    forecast = ProbabilityMatrix(9, Drift((4, 4), vector=(0.1, 0.2), diffusion=1 / 3))
    expected = forecast.at(7)
    for array in (forecast.at(7), forecast.exact(7), *forecast.marginals(7), *forecast.moves(7)):
        array[...] = 5.0
    for same in (forecast, copy.deepcopy(forecast), pickle.loads(pickle.dumps(forecast))):
        np.testing.assert_array_equal(same.at(7), expected)
        assert same.exact(7).sum() == pytest.approx(1)
        assert max(chances.max() for chances in same.moves(7)) <= 1
