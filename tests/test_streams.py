"""Random streams depend on the seed and the episode, not on earlier draws."""

import itertools

import numpy as np

from DroneSwarmSearch._internal.streams import EpisodeStream, episode_keys, stream_keys, uniforms


def stream(seed: int = 1) -> EpisodeStream:
    return EpisodeStream(stream_keys(seed)[0])


def splitmix(state: int) -> int:
    """SplitMix64's output for a state, in Python's own integers."""
    z = state % 2**64
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) % 2**64
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) % 2**64
    return z ^ (z >> 31)


def test_the_generator_is_splitmix64():
    # The first outputs of the published generator from the state 0.
    golden = 0x9E3779B97F4A7C15
    assert [splitmix(golden * n) for n in (1, 2)] == [0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4]
    key = int(stream_keys(5)[0])
    episode = splitmix(key + golden * (3 + 1))
    expected = [(splitmix(episode + golden * (n + 1)) >> 11) / 2**53 for n in range(300)]
    assert stream(5).between(3, 0, 300) == expected


def test_a_scalar_draw_equals_the_draw_in_an_array():
    keys = np.array([stream_keys(seed)[0] for seed in range(40)])[:, None]
    episodes = np.arange(50, dtype=np.uint64)
    places = np.arange(7, dtype=np.uint64)
    table = uniforms(episode_keys(keys, episodes)[..., None], places)
    for seed, episode in ((0, 0), (39, 49), (7, 33)):
        assert stream(seed).between(episode, 0, 7) == table[seed, episode].tolist()


def test_draws_do_not_depend_on_block_sizes():
    whole = stream().between(0, 0, 400)
    for portions in ([1] * 400, [16, 16, 32, 64, 272], [7, 393], [15, 2, 383]):
        parts = stream()
        places = itertools.pairwise(itertools.accumulate(portions, initial=0))
        drawn = (parts.between(0, begin, end) for begin, end in places)
        assert list(itertools.chain.from_iterable(drawn)) == whole
    assert all(0 <= number < 1 for number in whole) and len(set(whole)) == 400
