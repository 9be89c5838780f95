"""Mirror ascent and its objective: tangents lie above, no mixture exceeds the bound."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_searches import forecast_of, search

from DroneSwarmSearch.bound import (
    RememberingDrones,
    Trajectories,
    TrajectoryObjective,
    enumerate_trajectories,
    equally_likely,
    mirror_ascent,
    sample_trajectories,
)

Floats = np.ndarray

OF = search(
    [(0, 0), (2, 0)], grid_size=5, person_initial_position=(2, 3), vector=(0.2, -0.4),
    disperse_constant=6, timestep_limit=5, probability_of_detection=0.6,
)  # fmt: skip


def drones_on(trajectories: Trajectories | None, detection: float = 0.6) -> RememberingDrones:
    assert trajectories is not None
    return RememberingDrones(trajectories, 5, detection, [0, 2], memory=2)


def success(collected: Floats, detection: float) -> Floats:
    """min(Z, g(N)), with g(N) = 1 - (1 - q)^N joined by straight lines at whole N."""
    credits, searches = collected
    whole = np.arange(math.ceil(searches.max()) + 1.0)
    return np.minimum(credits, np.interp(searches, whole, 1 - (1 - detection) ** whole))


@settings(max_examples=40, derandomize=True)
@given(
    st.sampled_from([1.0, 0.9, 0.6, 0.1, 0.0]),
    st.sampled_from([0.3, 0.1, 0.001]),
    st.integers(0, 2**32),
)
def test_tangents_lie_above_and_nearly_touch(q, width, seed):
    rng = np.random.default_rng(seed)
    objective = TrajectoryObjective(q)
    searches = rng.choice([0.3, 2.0, 9.0]) * rng.random((2, 300))
    # Credits are at most q for each search.
    point, other = (np.array([q * each * rng.random(300) ** 0.2, each]) for each in searches)
    above, slopes = objective.tangent(point, width)
    assert (slopes >= 0).all()
    np.testing.assert_allclose(objective.value(point), success(point, q), atol=1e-12)
    assert (success(other, q) <= above + (slopes * other).sum(axis=0) + 1e-12).all()
    shortfall = above + (slopes * point).sum(axis=0) - success(point, q)
    assert (shortfall >= -1e-12).all()
    assert (shortfall <= q * width + 1e-12).all()


@pytest.mark.parametrize("detection", [1.0, 0.6])
def test_no_mixture_exceeds_the_bound(detection):
    drones = drones_on(enumerate_trajectories(forecast_of(OF), 5), detection)
    objective = TrajectoryObjective(detection)
    rng = np.random.default_rng(0)
    solved = mirror_ascent(drones, objective, gap=0.002, iterations=300)
    assert 0.1 < solved.value <= solved.upper_bound <= 1.01 * solved.value
    intercept, slopes = solved.tangents
    most = intercept + drones.most(drones.sums(slopes))
    assert solved.upper_bound == pytest.approx(most, rel=1e-6)
    for temperature in (1.0, 30.0, 1000.0):
        sums = drones.sums(temperature * drones.probabilities * rng.random((2, 1)))
        collected = drones.collected(drones.soft_flow(sums))
        mean = float(drones.probabilities @ success(collected, detection))
        assert mean <= solved.upper_bound + 1e-6


def test_batches_lead_to_the_same_maximum():
    """All trajectories, a sample as a whole, and in batches, which still are one sample."""
    model = forecast_of(OF)
    objective = TrajectoryObjective(0.6)
    exact = mirror_ascent(
        drones_on(enumerate_trajectories(model, 5)), objective, gap=0.002, iterations=300
    )
    count = 20_000
    drones = drones_on(sample_trajectories(model, 5, count))
    for batch in (count, 3000):
        solved = mirror_ascent(drones, objective, gap=0.002, iterations=300, batch=batch)
        assert solved.value == pytest.approx(exact.value, abs=0.01)
        assert solved.value <= solved.upper_bound <= 1.01 * solved.value
        assert 0.8 * count <= solved.effective <= count * (1 + 1e-9)


def test_weights_that_repeat_count_for_less():
    """After one batch of two, the bound rests on half of the sample."""
    trajectories = equally_likely(sample_trajectories(forecast_of(OF), 5, 1000).cells)
    objective = TrajectoryObjective(0.6)
    solved = mirror_ascent(drones_on(trajectories), objective, gap=0.0, iterations=1, batch=500)
    assert solved.effective == pytest.approx(500)
