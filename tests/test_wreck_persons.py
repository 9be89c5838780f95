"""Persons of one wreck, from one uncertain wind and current: `leeway.persons`."""

from typing import Any

import numpy as np
import pytest

from DroneSwarmSearch import DroneSwarmSearch, Scale, Scenario, leeway
from DroneSwarmSearch.persons import Drift

SCALE = Scale(metres_per_cell=200.0, seconds_per_step=60.0)
SEA = {"start": (20, 20), "wind": (6, 2), "current": (0.1, 0.2), "scale": SCALE}
CELLS = 60.0 / 200.0  # per step, for 1 m/s


def group(classes: list[str], **changes: Any) -> list[Any]:
    return leeway.persons(classes, **{**SEA, **changes})


def moments(drifts: tuple[Drift, ...]) -> tuple[np.ndarray, np.ndarray]:
    """The mean and the variance of the displacement in the first step."""
    weights = np.array([drift.weight for drift in drifts])
    means = np.array([np.atleast_2d(drift.vector)[0] for drift in drifts])
    spreads = np.array([np.atleast_2d(drift.vector_sd)[0] for drift in drifts])
    mean = weights @ means
    return mean, weights @ (spreads**2 + (means - mean) ** 2)


@pytest.mark.parametrize("count", [2, 8, 9, 16, 40])
def test_the_hypotheses_have_the_mean_and_the_errors_of_the_current(count):
    [alone] = group(["PIW-1"])
    [uncertain] = group(["PIW-1"], current_sd=0.3, hypotheses=count)
    assert len(uncertain.drift.drifts) == count
    mean, variance = moments(alone.drift.drifts)
    other_mean, other_variance = moments(uncertain.drift.drifts)
    assert other_mean == pytest.approx(mean)
    assert other_variance == pytest.approx(variance + (0.3 * CELLS) ** 2, rel=1e-6)


def test_both_sides_of_the_wind_are_in_each_hypothesis():
    """With the mean and the variance of `leeway.person`, which has them apart."""
    apart = leeway.person("PIW-1", jibing=0.0, **SEA)
    [together] = group(["PIW-1"], jibing=0.0)
    assert len(apart.drift.drifts) > 1 == len(together.drift.drifts)
    for one, other in zip(moments(apart.drift.drifts), moments(together.drift.drifts), strict=True):
        assert other == pytest.approx(one, rel=1e-6)


def test_hypothesis_k_of_each_person_is_the_same_sea():
    swimmer, raft = group(["PIW-1", "LIFE-RAFT-NB-1"], wind_sd=2.0, current_sd=0.3)
    first, second = (
        np.array([np.atleast_2d(drift.vector)[0] for drift in person.drift.drifts])
        for person in (swimmer, raft)
    )
    assert swimmer.drift.weights == raft.drift.weights
    # A raft feels the wind more, and the current as much.
    assert second.std() > first.std()
    for axis in (0, 1):
        assert np.corrcoef(first[:, axis], second[:, axis])[0, 1] > 0.8
    scenario = Scenario(40, 2, persons=[swimmer, raft], shared_drift=True, bayesian_update=True)
    env = DroneSwarmSearch(scenario=scenario)
    env.reset(seed=0)
    env.step({"drone0": 4, "drone1": 4})
    assert env.frame().hypotheses[0] == pytest.approx(env.frame().hypotheses[1])


def test_winds_may_vary_and_objects_may_have_been_adrift():
    winds = {0: (6, 2), 3600: (-3, 4)}
    swimmers = group(["PIW-1"] * 3, wind=winds, wind_sd=1.5, adrift=1800, position_sd=300)
    assert len(swimmers) == 3
    assert len({person.drift.key for person in swimmers}) == 1
    for drift in swimmers[0].drift.drifts:
        assert drift.adrift == 30 and (np.asarray(drift.vector_sd) >= 0).all()


WRONG = {
    "no classes": ([], {}, "object_classes must be a sequence of object classes"),
    "a text": ("PIW-1", {}, "object_classes must be"),
    "an unknown class": (["PIW-99"], {}, "object_class must be a key of leeway.CLASSES"),
    "a negative error": (["PIW-1"], {"wind_sd": -1}, "wind_sd must be"),
    "one hypothesis": (["PIW-1"], {"hypotheses": 1}, "hypotheses must be an integer of at least 2"),
    "no scale": (["PIW-1"], {"scale": 3}, "scale must be a Scale"),
}


@pytest.mark.parametrize(("classes", "changes", "message"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_refused(classes, changes, message):
    with pytest.raises((TypeError, ValueError), match=message):
        group(classes, **changes)
