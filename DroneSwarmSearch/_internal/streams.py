"""Random streams: one for each purpose, with a sequence of uniforms for each episode.

Each random draw is a function of the seed, the purpose, the episode (resets since the seed)
and the index in the episode's sequence. A single environment and a batch therefore draw the same
uniforms, regardless of how many they draw at once. The drones' actions do not affect them: with the
same seed, all policies face the same persons (common random numbers).

The generator is SplitMix64 (Steele, Lea and Flood, Fast splittable pseudorandom number
generators, OOPSLA 2014): a counter that increases by an odd constant, followed by a mixing
function. Seeds are expanded by NumPy's `SeedSequence`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Words

GOLDEN = np.uint64(0x9E3779B97F4A7C15)
"""The counter's increment, close to 2**64 / golden ratio, so that multiples spread evenly."""

_SHIFTS = np.array([30, 27, 31], np.uint64)
_FACTORS = np.array([0xBF58476D1CE4E5B9, 0x94D049BB133111EB], np.uint64)
_LOWEST_BITS = np.uint64(11)  # a double holds the 53 above them
_UNIT = np.float64(2.0**-53)
_ONE = np.uint64(1)

_POLICY = 3  # the place of the policies' key among the words of a seed

# A NumPy call costs more than an episode of a few steps, which is typical of untrained drones.
# So the first uniforms are computed for several episodes at once, and later ones in large chunks.
_EPISODES = 32
_FIRST = 16
_CHUNK = 256


def stream_keys(seed: int | None) -> Words:
    """The keys of a seed's streams, uint64: drift, detection, sampling of parameters, start.

    A seed of None uses entropy from the operating system.
    """
    state = np.random.SeedSequence(seed).generate_state(5, np.uint64)
    keys: Words = np.delete(state, _POLICY)
    return keys


def policy_key(seed: int) -> np.uint64:
    """The key of a policy's stream, which differs from the environment's for the same seed."""
    key: np.uint64 = np.random.SeedSequence(seed).generate_state(_POLICY + 1, np.uint64)[_POLICY]
    return key


def episode_keys(keys: Words, episodes: Words) -> Words:
    """The keys of the sequences of episodes, resets since the seed; both broadcast."""
    return mixed(keys + (episodes + _ONE) * GOLDEN)


def uniforms(keys: Words, indices: Words) -> Floats:
    """The uniforms in [0, 1) at indices, from 0, in the sequences of episodes; both broadcast."""
    return uniforms_of(keys + (indices + _ONE) * GOLDEN)


def uniforms_of(counters: Words) -> Floats:
    """The uniforms of counters: an episode's key plus `GOLDEN` times the index, from 1."""
    words = mixed(counters)
    words >>= _LOWEST_BITS
    return np.multiply(words.view(np.int64), _UNIT)


def mixed(words: Words) -> Words:
    """SplitMix64's mixing function; a new array."""
    shifted = np.right_shift(words, _SHIFTS[0])
    result: Words = np.bitwise_xor(words, shifted)
    result *= _FACTORS[0]
    np.right_shift(result, _SHIFTS[1], out=shifted)
    result ^= shifted
    result *= _FACTORS[1]
    np.right_shift(result, _SHIFTS[2], out=shifted)
    result ^= shifted
    return result


class EpisodeStream:
    """One of the streams of `stream_keys`, read episode after episode, as Python floats."""

    def __init__(self, key: np.uint64) -> None:
        self._key = np.array([key])
        # The first of some episodes, and the keys and first uniforms of all of them.
        self._heads: tuple[int, Words, list[list[float]]] = 0, self._key[:0], []
        self._episode = -1
        self._known: list[float] = []
        self._known_first = 0  # the index of the first of them

    def between(self, episode: int, begin: int, end: int) -> list[float]:
        """The uniforms of an episode from one index to another; `begin` never decreases in it."""
        if episode != self._episode:
            self._begin(episode)
        if end > self._known_first + len(self._known):
            indices = np.arange(begin, max(end, begin + _CHUNK), dtype=np.uint64)
            first, keys, _ = self._heads
            self._known = uniforms(keys[[episode - first]], indices).tolist()
            self._known_first = begin
        return self._known[begin - self._known_first : end - self._known_first]

    def _begin(self, episode: int) -> None:
        first, _, heads = self._heads
        if not 0 <= episode - first < len(heads):
            first = episode
            keys = episode_keys(self._key, np.arange(first, first + _EPISODES, dtype=np.uint64))
            heads = uniforms(keys[:, None], np.arange(_FIRST, dtype=np.uint64)).tolist()
            self._heads = first, keys, heads
        self._known = heads[episode - first]
        self._known_first = 0
        self._episode = episode


class Streams(NamedTuple):
    """The streams of an environment, one for each purpose."""

    drift: EpisodeStream  # two uniforms per step and person, for the moves along x and y
    detection: EpisodeStream  # a uniform per step and person, for searches
    start: EpisodeStream  # a uniform per person, for the hypothesis and the cell at step 0

    @classmethod
    def from_seed(cls, seed: int | None) -> Streams:
        """The streams of a seed; without one, of entropy from the operating system."""
        drift, detection, _, start = stream_keys(seed)
        return cls(EpisodeStream(drift), EpisodeStream(detection), EpisodeStream(start))
