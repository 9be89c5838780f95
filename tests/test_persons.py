"""`Drift` and `Person`: plain validated data, and the share of a forecast beyond the grid."""

import copy
import dataclasses
import json
import math
import pickle
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import DroneSwarmSearch
from DroneSwarmSearch import Drift, Person

NAN = math.nan
INF = math.inf
PRIOR = np.arange(9.0).reshape(3, 3)
TIDE = Drift((3, 4), start_sd=1, vector={0: (0.4, 0), 4: (-0.4, 0.2)}, adrift=2, diffusion=0.1)
UNCERTAIN = Drift((3.5, -2), start_sd=(1, 2), vector=(0.1, 0.2), vector_sd=0.05, diffusion=0.1)


def test_values_are_kept_in_their_plain_form():
    drift = Drift(
        np.array([3.0, 4.0]), start_sd=np.float32(0), vector=[1, Fraction(1, 2)], vector_sd=[0, 2]
    )
    assert drift.start == (3, 4) and [type(number) for number in drift.start] == [int, int]
    assert drift.start_sd == (0.0, 0.0) and type(drift.start_sd[0]) is float
    assert drift.vector == (1.0, 0.5) and drift.vector_sd == (0.0, 2.0)
    assert (drift.diffusion, drift.adrift, drift.weight) == (0.0, 0, 1.0)
    assert Drift((-1.5, 90), adrift=3).start == (-1.5, 90.0)
    assert Drift((-1.5, 90), start_sd=(1, 0)).start == (-1.5, 90.0)


def test_an_array_is_copied_normalised_and_read_only():
    given = PRIOR.astype(np.float32)
    drift = Drift(given)
    given[0, 0] = 7
    np.testing.assert_allclose(drift.start, PRIOR / PRIOR.sum(), rtol=1e-15)
    assert drift.prior is drift.start and drift.start.dtype == np.float64
    with pytest.raises(ValueError, match="read-only"):
        drift.start[0, 0] = 1
    with pytest.raises(ValueError, match="WRITEABLE"):
        drift.start.flags.writeable = True
    assert Drift((0, 0)).prior is None


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (Drift((3, 4)), Drift(np.array([3.0, 4.0]), start_sd=[0, 0])),
        (Drift((3, 4), vector_sd=2), Drift([3, 4], vector_sd=np.array([2, 2]))),
        (Drift(PRIOR), Drift((PRIOR * 7).tolist())),
        (Drift(PRIOR), Drift(np.asfortranarray(PRIOR))),
        (Drift([[0.0, 1], [1, 1]]), Drift([[-0.0, 1], [1, 1]])),
        (Drift((3, 4), vector=[(1, 2)] * 3), Drift((3, 4), vector={5: (1, 2)})),
        (Drift((3, 4), vector=[(1, 2)] * 3), Drift((3, 4), vector=(1, 2))),
        (Drift((3, 4), vector_sd=np.full((3, 2), 2)), Drift((3, 4), vector_sd=2)),
        (Drift((3, 4), vector_sd=[(-2, 1)] * 3), Drift((3, 4), vector_sd=(2, 1))),
        (TIDE, dataclasses.replace(TIDE, vector=[*TIDE.vector.tolist(), (-0.4, 0.2)])),
        (Person(UNCERTAIN), Person([UNCERTAIN], 1)),
        (Person(Drift(PRIOR)), Person((Drift(PRIOR),))),
    ],
)
def test_equal_values_in_other_forms_are_equal(one, other):
    assert one == other and hash(one) == hash(other)


def test_a_series_has_a_row_for_each_step_until_the_last_change():
    rows = [(0.4, 0), (0.2, 0.05), (0, 0.1), (-0.2, 0.15), (-0.4, 0.2)]
    np.testing.assert_allclose(TIDE.vector, rows, atol=1e-15)
    with pytest.raises(ValueError, match="read-only"):
        TIDE.vector[0, 0] = 1
    assert "vector=<array of shape (5, 2)>, vector_sd=(0.0, 0.0)" in repr(TIDE)
    late = Drift((3, 4), vector={2: (1, 0), 3: (0, 1)}, vector_sd=[(1, 0), (-1, 2), (-1, 2)])
    assert late.vector.tolist() == [[1, 0], [1, 0], [1, 0], [0, 1]]
    assert late.vector_sd.tolist() == [[1, 0], [-1, 2]]


@pytest.mark.parametrize(
    "changes",
    [
        {"vector": [(0.1, 0.2), (0.1, 0)]},
        {"start": (3.5, -1)},
        {"vector_sd": (0.05, 0)},
        {"adrift": 1},
        {"weight": 2},
    ],
)
def test_other_values_are_different(changes):
    other = Drift(**{**UNCERTAIN.to_dict(), **changes})
    assert other != UNCERTAIN and Person(other) != Person(UNCERTAIN)
    assert (other.key == UNCERTAIN.key) == (changes == {"weight": 2})
    assert Drift(PRIOR) != Drift(PRIOR.T) and Drift(PRIOR).key != Drift(PRIOR.T).key
    assert UNCERTAIN != (3.5, -2)


@pytest.mark.parametrize("drift", [Drift((3, 4)), UNCERTAIN, TIDE, Drift(PRIOR + 0.1, weight=3)])
def test_copies_and_files_are_equal(drift):
    person = Person([drift, UNCERTAIN], 0.3)
    for copied in (
        copy.copy(person),
        copy.deepcopy(person),
        pickle.loads(pickle.dumps(person)),
        Person.from_dict(json.loads(json.dumps(person.to_dict()))),
        person if "array" in repr(person) else eval(repr(person), vars(DroneSwarmSearch)),
    ):
        assert copied == person and hash(copied) == hash(person)
        assert (
            copied.drift.drifts[0].prior is None or not copied.drift.drifts[0].prior.flags.writeable
        )
    assert Drift.from_dict(drift.to_dict()) == drift
    heavier = dataclasses.replace(drift, weight=7)
    assert heavier.key == drift.key and heavier.weight == 7


@given(st.lists(st.floats(1e-300, 1e300), min_size=1, max_size=6))
def test_weights_sum_to_1(weights):
    person = Person([Drift((0, 0), weight=weight) for weight in weights])
    assert math.fsum(person.drift.weights) == pytest.approx(1)
    assert person.drift.weights[0] == pytest.approx(
        float(Fraction(weights[0]) / sum(map(Fraction, weights)))
    )
    assert Person(Drift((0, 0), weight=weights[0])).drift.weights == (1.0,)


def test_the_start_must_fit_on_the_grid():
    person = Person([Drift((2, 1)), UNCERTAIN, Drift(PRIOR), Drift((99, -3.5), adrift=1)])
    person.drift.check(3, 100, "person")
    for drift, size, message in (
        (Drift((3, 1)), 3, r"persons\[0\]\.drifts\[1\]\.start\[0\] must .*0 to 2 .*got .*3, 1"),
        (Drift((2.5, 3), start_sd=(1, 0)), 3, r"drifts\[1\]\.start\[1\] must .*0 to 2 .*2\.5"),
        (Drift(PRIOR), 4, r"drifts\[1\]\.start must .*shape \(4, 4\), got .*shape \(3, 3\)"),
    ):
        with pytest.raises(ValueError, match=message):
            Person([Drift((0, 0)), drift]).drift.check(size, 100, "persons[0]")


def test_a_known_drift_leaves_the_grid_at_its_edge():
    drift = Drift((5, 5), vector=(0.5, 0))
    assert [drift.mass_beyond(7, step) for step in range(5)] == [0, 0, 0, 1, 1]
    drift = Drift((1, 1), vector=(-0.5, 0))
    assert [drift.mass_beyond(7, step) for step in range(5)] == [0, 0, 0, 0, 1]
    assert Drift((5, 5), vector=(1e308, 0), adrift=9).mass_beyond(7, 9) == 1


DRIFTING: dict[str, Any] = {
    "start": st.tuples(st.floats(-9, 20), st.floats(-9, 20)),
    "start_sd": st.tuples(st.floats(0.1, 5), st.floats(0.1, 5)),
    "vector": st.tuples(st.floats(-1, 1), st.floats(-1, 1)),
    "vector_sd": st.floats(0, 0.3),
    "diffusion": st.floats(0, 2 / 3),
    "adrift": st.integers(0, 9),
    "step": st.integers(0, 40),
}


@settings(max_examples=50)
@given(**DRIFTING)
def test_the_share_beyond_the_grid_is_that_of_the_gaussian(
    start, start_sd, vector, vector_sd, diffusion, adrift, step
):
    tau = adrift + step
    inside = 1.0
    for s, sd, v in zip(start, start_sd, vector, strict=True):
        scale = math.sqrt(2 * (sd**2 + diffusion * tau + (vector_sd * tau) ** 2))
        mean = s + v * tau
        inside *= (math.erf((10.5 - mean) / scale) - math.erf((-0.5 - mean) / scale)) / 2
    spread = {"start_sd": start_sd, "vector_sd": vector_sd, "diffusion": diffusion}
    drift = Drift(start, vector=vector, adrift=adrift, **spread)
    assert drift.mass_beyond(11, step) == pytest.approx(1 - inside, abs=1e-12)


def test_the_share_beyond_the_grid_is_a_mean_over_priors_and_hypotheses():
    common: dict[str, Any] = {"vector": (0.3, -0.1), "vector_sd": (0.1, 0), "diffusion": 0.2}
    cells = [Drift((x, y), **common) for y in range(3) for x in range(3)]
    expected = np.average([cell.mass_beyond(3, 4) for cell in cells], weights=PRIOR.ravel())
    assert 0.1 < expected < 0.9
    assert Drift(PRIOR, **common).mass_beyond(3, 4) == pytest.approx(expected)
    one_hot = (np.arange(9) == 5).reshape(3, 3).astype(float)
    assert Drift(one_hot, **common).mass_beyond(3, 4) == pytest.approx(cells[5].mass_beyond(3, 4))
    person = Person([Drift((1, 1)), Drift((1, 1), vector=(1, 0), weight=3)])
    assert person.drift.mass_beyond(3, 2) == 0.75
    there_and_back = Drift((1, 1), start_sd=0.1, vector=[(1, 0)] * 4 + [(-1, 0)] * 4 + [(0, 0)])
    shares = [there_and_back.mass_beyond(3, step) for step in (0, 4, 8, 99)]
    assert shares == pytest.approx([0, 1, 0, 0], abs=1e-5)
    assert Person(Drift((1, 1), vector=[(1, 0), (-1, 0)])).drift.vector == (1, 0)


DRIFTS: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"start": 3}, TypeError, "start must be a cell"),
    ({"start": (0.5, 0)}, ValueError, r"start\[0\] must be a whole .*unless start_sd or adrift"),
    ({"start": (0, -1)}, ValueError, r"start\[1\] must be a whole number of at least 0"),
    ({"start": np.zeros((3, 3))}, ValueError, "start must have a positive, finite sum, got 0"),
    ({"start": np.eye(3) - 1}, ValueError, "start must be an array .*at least 0, got -1"),
    ({"start": np.ones((3, 4))}, ValueError, r"start must be an array .*got \(3, 4\)"),
    ({"start": [["a", "b"], ["c", "d"]]}, TypeError, "start must be a cell"),
    ({"start": np.eye(3), "adrift": 1}, ValueError, "adrift must be 0 if start is an array, got 1"),
    ({"start_sd": (1,)}, ValueError, "start_sd must be a number"),
    ({"start_sd": (1, -2)}, ValueError, "start_sd must be .*at least 0, got -2"),
    ({"vector_sd": -0.1}, ValueError, "vector_sd must be .*at least 0, got -0.1"),
    ({"vector": [(0, 0), (1, NAN)]}, ValueError, "vector must be one vector, or vectors"),
    ({"vector": [(0, 0), (1, 2, 3)]}, ValueError, "vector must be one vector, or vectors"),
    ({"vector": np.zeros((4, 3))}, ValueError, "vector must be one vector, or vectors"),
    ({"vector": []}, ValueError, "vector must be two finite numbers"),
    ({"vector": {}}, ValueError, "vector must be one vector, or vectors"),
    ({"vector": {0.5: (0, 0)}}, TypeError, "a step of vector must be an integer .*got 0.5"),
    ({"vector": {1_700_000_000: (0, 0)}}, ValueError, "a step of vector must be .*to 10000000"),
    ({"vector": {2: 1}}, TypeError, r"vector\[2\] must be two finite numbers"),
    ({"diffusion": 0.7}, ValueError, "diffusion must be .* at most 0.666.*, got 0.7"),
    ({"weight": 0}, ValueError, "weight must be a finite number above 0, got 0"),
]

OTHERS: list[tuple[Any, Any, type[Exception], str]] = [
    (Person, None, TypeError, "drifts must be a Drift, a sequence of them or Tracks, got None"),
    (Person, [UNCERTAIN, {"start": (0, 0)}], TypeError, r"drifts\[1\] must be a Drift"),
    (Person, [], ValueError, "drifts must hold at least one Drift"),
    (lambda chance: Person(UNCERTAIN, chance), 1.1, ValueError, "detection must be .*got 1.1"),
    (Drift.from_dict, [], TypeError, "must be a mapping"),
    (Drift.from_dict, {"start": [0, 0], "speed": 1}, TypeError, "'speed'"),
    (Person.from_dict, {"probability_of_detection": 1}, TypeError, "drifts must be a list"),
    (Person.from_dict, {"drifts": [{"start": [0, 0]}], "name": "A"}, TypeError, "'name'"),
    (Person.from_dict, {"drifts": [{"start": [0, 0], "weight": 0}]}, ValueError, r"0\]: weight"),
]


@pytest.mark.parametrize(("values", "error", "message"), DRIFTS)
def test_bad_drifts_are_rejected(values, error, message):
    with pytest.raises(error, match=message):
        Drift(**{"start": (0, 0), **values})


@pytest.mark.parametrize(("make", "given", "error", "message"), OTHERS)
def test_bad_persons_and_files_are_rejected(make, given, error, message):
    with pytest.raises(error, match=message):
        make(given)


def test_bad_steps_and_grids_are_rejected():
    with pytest.raises(ValueError, match="grid_size must be"):
        UNCERTAIN.mass_beyond(1, 0)
    with pytest.raises(TypeError, match="step must be"):
        Person(UNCERTAIN).drift.mass_beyond(7, 0.5)
