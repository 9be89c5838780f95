"""Random streams depend on the seed and the episode, not on earlier draws."""

from __future__ import annotations

import copy
import itertools
import pickle

import numpy as np
import pytest

from DroneSwarmSearch._internal.streams import EpisodeStream, episode_keys, numbers, stream_keys


def stream(seed: int = 1) -> EpisodeStream:
    return EpisodeStream(stream_keys(seed)[0])


def splitmix(state: int) -> int:
    """SplitMix64's output for a state, in Python's own integers."""
    z = state % 2**64
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) % 2**64
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) % 2**64
    return z ^ (z >> 31)


def test_the_generator_is_splitmix64() -> None:
    # The first outputs of the published generator from the state 0.
    golden = 0x9E3779B97F4A7C15
    assert [splitmix(golden * n) for n in (1, 2)] == [0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4]
    key = int(stream_keys(5)[0])
    episode = splitmix(key + golden * (3 + 1))
    expected = [(splitmix(episode + golden * (n + 1)) >> 11) / 2**53 for n in range(300)]
    assert stream(5).between(3, 0, 300) == expected


def test_a_scalar_draw_equals_the_draw_in_an_array() -> None:
    keys = np.array([stream_keys(seed)[0] for seed in range(40)])[:, None]
    episodes, places = np.arange(50, dtype=np.uint64), np.arange(7, dtype=np.uint64)
    table = numbers(episode_keys(keys, episodes)[..., None], places)
    for seed, episode in ((0, 0), (39, 49), (7, 33)):
        assert stream(seed).between(episode, 0, 7) == table[seed, episode].tolist()


def test_draws_do_not_depend_on_block_sizes() -> None:
    whole = stream().between(0, 0, 400)
    for portions in ([1] * 400, [16, 16, 32, 64, 272], [7, 393], [15, 2, 383]):
        parts = stream()
        places = itertools.pairwise(itertools.accumulate(portions, initial=0))
        drawn = (parts.between(0, begin, end) for begin, end in places)
        assert list(itertools.chain.from_iterable(drawn)) == whole
    assert all(0 <= number < 1 for number in whole) and len(set(whole)) == 400


@pytest.mark.parametrize("drawn", [(3, 1, 100), (500, 16, 17)])
def test_an_episode_does_not_depend_on_earlier_ones(drawn: tuple[int, ...]) -> None:
    sequence = stream()
    for episode, count in enumerate(drawn):
        sequence.between(episode, 0, count)
    for episode in (3, 31, 32, 100):
        assert sequence.between(episode, 0, 60) == stream().between(episode, 0, 60)


def test_episodes_and_seeds_differ() -> None:
    sequence = stream()
    episodes = [tuple(sequence.between(episode, 0, 100)) for episode in range(70)]
    flat = list(itertools.chain.from_iterable(episodes))
    assert len(set(flat)) == len(flat)
    assert stream(2).between(0, 0, 100) != stream(1).between(0, 0, 100)


def test_places_may_be_left_out_and_repeated() -> None:
    for width in (1, 3, 16, 20):
        flat, parts = stream().between(2, 0, 50 * width), stream()
        assert parts.between(2, 0, width) == flat[:width]
        for _ in range(2):
            assert parts.between(2, 49 * width, 50 * width) == flat[49 * width :]


@pytest.mark.parametrize("through", [copy.deepcopy, lambda s: pickle.loads(pickle.dumps(s))])
@pytest.mark.parametrize("drawn", [5, 90])
def test_copies_continue_identically(through, drawn: int) -> None:
    sequence = stream()
    sequence.between(4, 0, drawn)
    twin = through(sequence)
    after = drawn + 50
    assert twin.between(4, drawn, after) == sequence.between(4, drawn, after)
    assert twin.between(7, 0, 50) == sequence.between(7, 0, 50)
