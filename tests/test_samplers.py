"""Samplers: parameters drawn for every episode, and their random numbers."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import pytest
from batches import CONSTANT, DRONES, NAN, PERSON, SAMPLED, everything_sampled, seen
from helpers import plain, without_history

from DroneSwarmSearch import DroneSwarmSearch
from DroneSwarmSearch._internal.streams import RowGenerator, stream_keys
from DroneSwarmSearch.vector import SearchBatch


def test_what_is_sampled_depends_on_seed_and_episode_alone() -> None:
    seeds = [4, 8, 15, 16, 23]
    together = SearchBatch(5, sampler=everything_sampled, **SAMPLED)
    together.reset(seeds)
    single = [SearchBatch(1, sampler=everything_sampled, **SAMPLED) for _ in seeds]
    for batch, seed in zip(single, seeds, strict=True):
        batch.reset([seed])
    rng = np.random.default_rng(1)
    different = set()
    for _ in range(80):
        rows = seen(together)
        assert rows == [seen(batch)[0] for batch in single]
        different |= {repr(row[-4:]) for row in rows}
        actions = rng.choice([0, 1, 2, 3, 4, 4, 4, 4], (5, 2))
        together.step(actions)
        for row, batch in enumerate(single):
            batch.step(actions[row : row + 1])
    assert len(different) > 40  # episodes, each with parameters of its own


def test_sampled_parameters_given_to_single_environments_make_the_same_episodes() -> None:
    seeds = list(range(6))
    batch = SearchBatch(len(seeds), sampler=everything_sampled, **SAMPLED)
    batch.reset(seeds)
    rng = np.random.default_rng(2)

    def begin(row: int, episode: int) -> DroneSwarmSearch:
        options = {name: value[row].tolist() for name, value in batch.parameters.items()}
        env = DroneSwarmSearch(**SAMPLED, disperse_constant=options.pop(CONSTANT))
        for number in range(episode + 1):
            env.reset(seed=None if number else seeds[row], options=options)
        return env

    episodes = [0] * len(seeds)
    envs = [begin(row, 0) for row in range(len(seeds))]
    for _ in range(60):
        ended, actions = batch.ended.tolist(), rng.choice([0, 1, 2, 3, 4, 4, 4], (len(seeds), 2))
        batch.step(actions)
        for row in range(len(seeds)):
            if ended[row]:
                episodes[row] += 1
                envs[row] = begin(row, episodes[row])
            else:
                drone0, drone1 = actions[row].tolist()
                rewards = envs[row].step({"drone0": drone0, "drone1": drone1})[1]
                assert list(rewards.values()) == batch.rewards[row].tolist()
            assert plain(vars(batch.frame(row))) == without_history(envs[row].frame())
    assert max(episodes) > 3


def test_what_is_not_sampled_is_as_the_batch_was_given_it() -> None:
    batch = SearchBatch(
        3,
        sampler=lambda rng: {"vector": rng.uniform(-1, 1, 2)},
        person_initial_position=[[(1, 1)], [(2, 2)], [(3, 3)]],
        disperse_constant=[1, 2, 3],
        drones_positions=[(5, 5)],
    )
    batch.reset([1, 2, 3])
    parameters = batch.parameters
    assert parameters[PERSON].tolist() == [[[1, 1]], [[2, 2]], [[3, 3]]]
    assert parameters[CONSTANT].tolist() == [1, 2, 3]
    assert parameters[DRONES].tolist() == [[[5, 5]]] * 3
    assert len(np.unique(parameters["vector"])) == 6


def test_what_reset_is_given_is_not_sampled_for_that_episode() -> None:
    batch, other = (SearchBatch(3, sampler=everything_sampled, **SAMPLED) for _ in range(2))
    for name, value in {CONSTANT: 7.5, PERSON: [[2, 3]], DRONES: [[1, 1], [4, 0]]}.items():
        batch.reset([1, 2, 3], given={name: value})
        other.reset([1, 2, 3])
        expected = other.parameters
        assert value not in expected[name].tolist()
        expected[name] = np.array([value] * 3)
        assert batch.parameters.keys() == expected.keys()
        for parameter, values in batch.parameters.items():
            assert values.tolist() == expected[parameter].tolist()
        batch.reset()
        other.reset()
        assert plain(batch.parameters) == plain(other.parameters)


def test_row_numbers_have_the_ranges_and_shapes_asked_for() -> None:
    rng = RowGenerator(stream_keys(1)[:3])
    assert len(rng) == 3
    for size, shape in (((), (3,)), (4, (3, 4)), ((2, 5), (3, 2, 5)), (0, (3, 0))):
        drawn = rng.random(size)
        assert drawn.shape == shape and drawn.dtype == np.float64
        assert rng.uniform(2, 3, size).shape == shape
        assert rng.integers(2, 9, size).shape == shape
    wide = RowGenerator(np.arange(4, dtype=np.uint64))
    uniform = wide.uniform([-3.0, 10.0], [-1.0, 11.0], (5000, 2))
    for column, (low, high) in enumerate([(-3, -1), (10, 11)]):
        drawn = uniform[..., column]
        assert low <= drawn.min() and drawn.max() < high
        error = (high - low) / math.sqrt(12 * drawn.size)
        assert abs(drawn.mean() - (low + high) / 2) < 5 * error
    integers = wide.integers([-2, 5], [1, 15], (5000, 2))
    assert integers.dtype == np.int64
    for column, (low, high) in enumerate([(-2, 1), (5, 15)]):
        values, counts = np.unique(integers[..., column], return_counts=True)
        assert values.tolist() == list(range(low, high))
        expected = integers[..., column].size / (high - low)
        assert np.abs(counts - expected).max() < 5 * math.sqrt(expected)


def test_row_numbers_go_on_and_do_not_depend_on_the_other_rows() -> None:
    keys = stream_keys(7)[:3]
    together = RowGenerator(keys)
    drawn = [together.random(3), together.uniform(0, 2), together.integers(0, 100, (2, 2))]
    for row in range(3):
        single = RowGenerator(keys[row : row + 1])
        again = [single.random(3), single.uniform(0, 2), single.integers(0, 100, (2, 2))]
        assert [plain(one[0]) for one in again] == [plain(one[row]) for one in drawn]
    assert RowGenerator(keys).random(3).tolist() == drawn[0].tolist()
    assert not set(together.random(3).ravel()) & set(drawn[0].ravel())


@pytest.mark.parametrize("size", [np.int64(3), np.uint8(3), (3,), [np.int32(3)], np.array([3])])
def test_sizes_of_random_numbers_may_be_numpy_integers(size: Any) -> None:
    keys = stream_keys(1)[:3]
    assert RowGenerator(keys).random(size).tolist() == RowGenerator(keys).random(3).tolist()
    assert RowGenerator(keys).integers(0, 9, size).shape == (3, 3)


@pytest.mark.parametrize("size", [2.0, True, -1, "3", (2, None), [(1, 2), 3], None])
def test_other_sizes_of_random_numbers_are_refused(size: Any) -> None:
    rng = RowGenerator(stream_keys(1)[:3])
    for draw in (rng.random, rng.uniform):
        with pytest.raises((TypeError, ValueError), match="size must be an integer of at least 0"):
            draw(size=size)
    assert rng.random(2).tolist() == RowGenerator(stream_keys(1)[:3]).random(2).tolist()


@pytest.mark.parametrize(
    ("low", "high", "error", "message"),
    [
        (15, 5, ValueError, "low must be below high, got 15 and 5"),
        (3, 3, ValueError, "low must be below high"),
        ([0, 9], [5, 9], ValueError, "low must be below high"),
        (0, 2.5, TypeError, "high must be an integer or an array of integers, got 2.5"),
        (0.5, 3, TypeError, "low must be an integer"),
        (0, np.nan, TypeError, "high must be an integer"),
        (0, 2**70, TypeError, "high must be an integer"),
        (0, "x", TypeError, "high must be an integer"),
        (0, [[1], [2, 3]], ValueError, "high must be an integer"),
    ],
)
def test_bounds_of_integers_are_checked(low: Any, high: Any, error: Any, message: str) -> None:
    rng = RowGenerator(stream_keys(1)[:3])
    with pytest.raises(error, match=message):
        rng.integers(low, high, 2)
    assert rng.random(2).tolist() == RowGenerator(stream_keys(1)[:3]).random(2).tolist()


@pytest.mark.parametrize(("low", "high"), [(0, 1), (5, 6), (5, 15), (1000, 1001), (-3, 4)])
def test_integers_stay_below_their_bound_whatever_is_drawn(
    low: int, high: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = RowGenerator(stream_keys(1)[:3])
    for number, expected in ((0.0, low), (1 - 2.0**-53, high - 1)):
        monkeypatch.setattr(rng, "random", lambda size=(), number=number: np.full(3, number))
        assert rng.integers(low, high).tolist() == [expected] * 3


class Configurable:
    """A sampler that returns or raises a class attribute, which copies do not contain."""

    result: Any = None

    def __call__(self, rng: RowGenerator) -> Any:
        if isinstance(self.result, Exception):
            raise self.result
        return self.result


BAD_SAMPLES: list[tuple[Any, type[Exception], str]] = [
    (None, TypeError, "sampler must return a mapping, got None"),
    ([("vector", (0, 0))], TypeError, "sampler must return a mapping"),
    ({"speed": 1}, ValueError, "'speed'"),
    ({"timestep_limit": 5}, ValueError, "'timestep_limit'"),
    ({"vector": np.zeros((7, 2))}, ValueError, "vector"),
    ({"vector": (0, NAN)}, ValueError, "vector"),
    ({"vector": "ab"}, TypeError, "vector"),
    ({CONSTANT: -1.0}, ValueError, CONSTANT),
    ({PERSON: (7, 0)}, ValueError, PERSON),
    ({PERSON: np.zeros((1, 3, 2), int)}, ValueError, PERSON),
    ({DRONES: [(0, 0), (0, 0)]}, ValueError, f"{DRONES} must hold different cells"),
    ({DRONES: [(0, 0)]}, ValueError, DRONES),
    (KeyError("broken"), KeyError, "broken"),
]


@pytest.mark.parametrize(("result", "error", "match"), BAD_SAMPLES)
def test_a_sampler_that_fails_leaves_the_batch_as_it_was(
    result: Any, error: type[Exception], match: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    batch = SearchBatch(3, n_drones=2, timestep_limit=2, sampler=Configurable())
    monkeypatch.setattr(Configurable, "result", {"vector": (0.5, 0.5)})
    batch.reset([1, 2, 3])
    batch.step(np.full((3, 2), 5))
    batch.reset([4], np.array([1]))  # so that it is in mid-episode while the others end
    batch.step(np.full((3, 2), 5))
    assert batch.ended.tolist() == [True, False, True]
    twin = copy.deepcopy(batch)
    monkeypatch.setattr(Configurable, "result", result)
    for begin in (
        batch.reset,
        lambda: batch.reset([9], np.array([1]), {"vector": (0.1, 0.1)}),
        lambda: batch.restart(np.array([0])),
        lambda: batch.step(np.full((3, 2), 5)),
    ):
        with pytest.raises(error, match=match):
            begin()
        assert seen(batch) == seen(twin)
    monkeypatch.setattr(Configurable, "result", {"vector": (0.2, 0.5)})
    for _ in range(4):
        for each in (batch, twin):
            each.step(np.full((3, 2), 5))
        assert seen(batch) == seen(twin)
