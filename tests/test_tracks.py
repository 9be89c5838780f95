"""Persons who drift as tracks do: the chain equals the tracks, and says what is wrong with them."""

import copy
import json
import pickle
from itertools import pairwise

import numpy as np
import pytest
from helpers import wandering
from hypothesis import given
from hypothesis import strategies as st

from DroneSwarmSearch import Action, DroneSwarmSearch, Person, Scenario, Tracks, policies
from DroneSwarmSearch.drift import drift_model
from DroneSwarmSearch.evaluation import evaluate, share_found

STEPS = 12
SIZE = 5
TRACKS = wandering(3000, STEPS, start=(1, 1), drift=(0.2, 0.1))
# Two tracks: one to the right and one down, both ashore in the end.
PAIR = np.array([[[0, 0], [0, 0]], [[1, 0], [0, 1]], [[2, 0], [0, 2]], [[2, 0], [0, 2]]], float)

few = pytest.mark.filterwarnings("ignore:.*tracks are few")


def histogram(tracks: Tracks, step: int, size: int = SIZE) -> np.ndarray:
    x, y = np.clip(np.rint(tracks.positions[step].T), 0, size - 1).astype(int)
    return np.bincount(y * size + x, tracks.weights, size**2).reshape(size, size)


@few
@given(
    seed=st.integers(0, 99),
    fine=st.integers(1, 3),
    classes=st.integers(1, 4),
    size=st.integers(2, 6),
    is_weighted=st.booleans(),
)
def test_the_matrix_is_the_histogram_of_the_tracks(seed, fine, classes, size, is_weighted):
    rng = np.random.default_rng(seed)
    moves = rng.normal((0.1, 0), 0.4, (8, 50, 2)).clip(-1, 1)
    tracks = Tracks(
        moves.cumsum(axis=0).clip(-0.4, size - 0.6), rng.random(50) if is_weighted else None
    )
    assert (tracks.stranded, tracks.lost) == (0, 0)
    model = drift_model(Person(tracks, fine=fine, classes=classes).drift, size)
    mass = model.joint(0)
    value = rng.random(model.state_shape)
    for step in range(9):  # the tracks have 7 steps
        expected = histogram(tracks, min(step, 7), size)
        np.testing.assert_allclose(model.map(mass), expected, atol=1e-12)
        np.testing.assert_allclose(model.exact(step), expected, atol=1e-12)
        after = model.forward(mass, step)
        assert (after * value).sum() == pytest.approx((mass * model.backward(value, step)).sum())
        mass = after


@pytest.mark.parametrize(("fine", "classes"), [(1, 1), (2, 1), (2, 3)])
def test_persons_are_where_the_matrix_says_and_go_where_tracks_went(fine, classes):
    model = drift_model(Person(TRACKS, fine=fine, classes=classes).drift, SIZE)
    count = 20_000
    cells = np.clip(np.rint(TRACKS.positions), 0, SIZE - 1).astype(int) @ [1, SIZE]
    rng = np.random.default_rng(0)
    states = model.start(rng.random(count))
    for step in range(STEPS):
        here = model.cells(states)
        shares = np.bincount(here, minlength=SIZE**2) / count
        assert abs(shares - model.exact(step).reshape(-1)).sum() / 2 < 0.02
        draws = rng.random(count)
        after = model.moved(states, step, draws, draws)
        went = set(zip(cells[step].tolist(), cells[step + 1].tolist(), strict=True))
        assert set(zip(here.tolist(), model.cells(after).tolist(), strict=True)) <= went
        for k in range(20):
            assert model.walk(int(states[k]), step, [draws[k]], [0.0]) == [after[k]]
        states = after


def test_the_posterior_is_bayes_rule_on_the_cells_of_the_tracks():
    """With fine=1, by dense transition matrices counted from the tracks."""
    env = DroneSwarmSearch(
        SIZE, persons=Person(TRACKS, 0.7, fine=1), timestep_limit=STEPS,
        mission="coverage", bayesian_update=True,
    )  # fmt: skip
    cells = np.rint(TRACKS.positions).astype(int) @ [1, SIZE]
    belief = histogram(TRACKS, 0).reshape(-1)
    kept = 1.0
    env.reset(seed=0, options={"drones_positions": [(1, 1)]})
    for before, after in pairwise(cells[:6]):
        belief[SIZE + 1] *= 0.3
        kept *= belief.sum()
        counts = np.zeros((SIZE**2, SIZE**2))
        np.add.at(counts, (before, after), 1.0)
        chances = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
        belief = belief / belief.sum() @ chances
        observations, _, _, _, infos = env.step({"drone0": Action.SEARCH})
        matrix = observations["drone0"]["observation"][1]
        np.testing.assert_allclose(matrix.reshape(-1), belief, atol=1e-6)
        assert infos["probability_of_success"] == pytest.approx(1 - kept, abs=1e-12)
    assert kept < 0.5


@few
def test_found_counts_the_tracks_in_searched_cells():
    tracks = Tracks(np.repeat(PAIR, [3, 1], axis=1))
    scenario = Scenario(3, persons=Person(tracks, 0.5), timestep_limit=3)
    plan = [[Action.RIGHT], [Action.SEARCH], [Action.RIGHT]]
    assert share_found(tracks, plan, scenario) == pytest.approx(0.75 * 0.5)
    idle = [[Action.IDLE]] * 3
    assert share_found(tracks, idle, scenario, drones_positions=[(0, 2)]) == 0.0
    late = [[Action.IDLE], [Action.IDLE], [Action.SEARCH]]
    assert share_found(tracks, late, scenario, drones_positions=[(0, 2)]) == pytest.approx(
        0.25 * 0.5
    )


def test_plans_find_as_many_held_out_tracks_as_they_promise():
    fitted, held_out = TRACKS.split()
    scenario = Scenario(
        SIZE, persons=Person(fitted, 0.8), timestep_limit=STEPS, bayesian_update=True
    )
    for name in ("greedy-posterior", "planner"):
        promised = evaluate(name, scenario, episodes=1).success.value
        found = share_found(held_out, policies.make(name, scenario))
        assert found == pytest.approx(promised, abs=0.05)
        assert found > 0.5


def test_splits_are_random_parts():
    fitted, held_out = TRACKS.split(0.2, seed=3)
    assert (len(fitted), len(held_out)) == (2400, 600)
    both = np.concatenate([fitted.positions, held_out.positions], axis=1)
    for axis in (0, 1):
        assert np.array_equal(np.sort(both[-1, :, axis]), np.sort(TRACKS.positions[-1, :, axis]))
    even = np.isin(held_out.positions[-1, :, 0], TRACKS.positions[-1, ::2, 0]).mean()
    assert 0.35 < even < 0.65
    assert fitted.weights.sum() == pytest.approx(1)
    assert not np.array_equal(TRACKS.split(0.2)[1].positions, held_out.positions)
    assert len(TRACKS.thin(100)) == 100


def test_tracks_that_end_in_nan_stay():
    positions = PAIR.copy()
    positions[2:, 0] = np.nan
    tracks = Tracks(positions)
    assert tracks.positions[:, 0].tolist() == [[0, 0], [1, 0], [1, 0], [1, 0]]
    assert tracks.stranded == 1
    assert repr(tracks) == "<Tracks: 2 tracks, 3 steps, 1 stranded, x 0.0 to 1.0, y 0.0 to 2.0>"
    assert Tracks(PAIR, [1, 0]).positions.shape == (4, 1, 2)


@few
def test_tracks_of_a_vanishing_weight_are_left_out():
    """Such as the likelihood of a far position; rounding to 0 made persons jump."""
    positions = np.array([[[0, 0], [3, 3]], [[1, 0], [4, 3]]])
    tracks = Tracks(positions, [2, 5e-324])
    assert len(tracks) == 1
    model = drift_model(Person(tracks).drift, 5)
    assert np.array_equal(model.forward(model.joint(0), 0), model.joint(1))


@few
def test_files_give_the_same_person(tmp_path):
    path = tmp_path / "tracks.npz"
    TRACKS.save(path)
    tracks = Tracks.read(path)
    for step in (0, 5, STEPS):
        a, b = (drift_model(Person(each).drift, SIZE).joint(step) for each in (TRACKS, tracks))
        np.testing.assert_allclose(a, b, atol=1e-15)
    scenario = Scenario(SIZE, persons=Person(tracks, 0.8, classes=2), timestep_limit=STEPS)
    scenario.to_dict()["persons"][0]["tracks"]["file"] = "another"  # a copy
    data = json.loads(json.dumps(scenario.to_dict()))
    assert Scenario.from_dict(data) == scenario
    assert tracks.to_dict()["sha256"] == data["persons"][0]["tracks"]["sha256"]
    TRACKS.thin(500).save(path)
    with pytest.raises(ValueError, match="its SHA-256 was saved; it has changed"):
        Scenario.from_dict(data)
    arrays = Scenario(SIZE, persons=Person(TRACKS), timestep_limit=STEPS).to_dict()
    assert arrays["persons"][0]["tracks"]["file"] is None
    with pytest.raises(ValueError, match=r"given as arrays: write such tracks with Tracks.save"):
        Scenario.from_dict(arrays)


def test_copies_are_equal_and_share_what_is_large():
    person = Person(TRACKS, 0.8)
    assert copy.deepcopy(person).drift.tracks is TRACKS
    assert drift_model(person.drift, SIZE) is drift_model(person.drift, SIZE)
    again = pickle.loads(pickle.dumps(person))
    assert again == person and hash(again) == hash(person) and again != Person(TRACKS, 0.7)
    zeros = np.zeros((2, 1, 2))
    assert Tracks(zeros) == Tracks(-zeros) and hash(Tracks(zeros)) == hash(Tracks(-zeros))
    model = pickle.loads(pickle.dumps(drift_model(person.drift, SIZE)))
    assert np.array_equal(model.joint(3), drift_model(person.drift, SIZE).joint(3))


JUMP = PAIR + [[[0, 0]], [[1, 0]], [[2, 0]], [[4, 0]]]
GAP = PAIR.copy()
GAP[1, 1] = np.nan


@pytest.mark.parametrize(
    ("positions", "weights", "error", "message"),
    [
        (JUMP, None, ValueError, r"track 0 moves 2 in step 1, .* shorter steps or larger cells"),
        (GAP, None, ValueError, "NaN at the start or in the middle, in 1 tracks.* track 1"),
        (np.where(PAIR == 2, np.inf, PAIR), None, ValueError, "positions must be finite"),
        (PAIR[0], None, ValueError, r"of shape \(steps \+ 1, tracks, 2\).* got shape \(2, 2\)"),
        (PAIR[:1], None, ValueError, "positions must be real numbers of shape"),
        (PAIR[:, :0], None, ValueError, "positions must be real numbers of shape"),
        ("drift.nc", None, TypeError, "positions must be real numbers"),
        (PAIR, [1, 2, 3], ValueError, "weights must be 2 finite numbers"),
        (PAIR, [0, 0], ValueError, "weights must be .* not all 0"),
        (PAIR, [1, -1], ValueError, "weights must be .* at least 0"),
        (PAIR, [1, np.nan], ValueError, "weights must be 2 finite numbers"),
    ],
)
def test_bad_tracks_are_rejected(positions, weights, error, message):
    with pytest.raises(error, match=message):
        Tracks(positions, weights)


@few
def test_bad_parameters_are_rejected(tmp_path):
    pair = Tracks(PAIR)
    tracks = TRACKS
    with pytest.raises(ValueError, match="fine must be an integer from 1 to 4, got 5"):
        Person(tracks, fine=5)
    with pytest.raises(ValueError, match="classes must be an integer of at least 1, got 0"):
        Person(tracks, classes=0)
    for other in ("drift.nc", [tracks]):
        with pytest.raises(TypeError, match="drifts"):
            Person(other)
    with pytest.raises(ValueError, match="timestep_limit must be at most 3, the steps of the trac"):
        Scenario(3, persons=Person(pair), timestep_limit=4)
    with pytest.raises(ValueError, match=r"held_out must leave tracks in both parts, got 0.1"):
        pair.split(0.1)
    with pytest.raises(ValueError, match="n must be an integer from 1 to 2"):
        pair.thin(3)
    with pytest.raises(ValueError, match="seed must be an integer of at least 0, got -1"):
        pair.thin(1, seed=-1)
    with pytest.raises(ValueError, match=r"path must end in \.npz"):
        pair.save(tmp_path / "tracks.txt")
    np.savez(tmp_path / "other.npz", a=1)
    with pytest.raises(ValueError, match=r"must be a file of Tracks\.save"):
        Tracks.read(tmp_path / "other.npz")
    with pytest.raises(TypeError, match="scenario must be a Scenario, got None"):
        share_found(pair, [[5]])
    with pytest.raises(TypeError, match="policy must be a policy or a plan, got 'planner'"):
        share_found(pair, "planner", Scenario(3, persons=Person(pair), timestep_limit=3))
    with pytest.raises(ValueError, match="scenario must have one person, got 2"):
        share_found(pair, [[5]], Scenario(3, persons=[Person(pair)] * 2, timestep_limit=3))


def test_too_few_tracks_and_a_small_grid_are_warned_of():
    with pytest.warns(
        UserWarning, match=r"40 tracks are few: of a quarter held out, \d+% .*take more tracks"
    ):
        Person(TRACKS.thin(40))
    with pytest.warns(UserWarning, match="of tracks leave the grid of 3 x 3 cells"):
        drift_model(Person(TRACKS).drift, 3)
