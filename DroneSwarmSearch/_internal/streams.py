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

from DroneSwarmSearch._internal.arrays import Floats, Ints, Words

__all__ = [
    "DENOMINATOR",
    "EpisodeStream",
    "Streams",
    "episode_keys",
    "mixed",
    "numbers",
    "numerators",
    "policy_key",
    "stream_keys",
    "unit_numbers",
]


GOLDEN = np.uint64(0x9E3779B97F4A7C15)
"""The counter's increment, close to 2**64 / golden ratio, so that multiples spread evenly."""


def _words(*values: int) -> tuple[Words, ...]:
    """Constants as 0-d arrays: array arithmetic with them is faster than with scalars."""
    return tuple(np.array(value, np.uint64) for value in values)


_SHIFTS = _words(30, 27, 31)
_FACTORS = _words(0xBF58476D1CE4E5B9, 0x94D049BB133111EB)
_ONE = np.uint64(1)
_LOWEST_BITS = _words(11)[0]  # a double holds the 53 above them

DENOMINATOR = 2.0**53
"""Uniforms are `numerators` divided by this."""

_POLICY = 3
"""The place of the policies' key among the words of a seed."""

_UNIT = np.array(1 / DENOMINATOR)

# A NumPy call costs more than an episode of a few steps, which is typical of untrained drones.
# So the first uniforms are computed for several episodes at once, and later ones in large
# chunks. The pairs are (episodes, uniforms of each).
_SHORT = (32, 16)
_LONG = (8, 256)
_CHUNK = 256
_NEXT = np.arange(1, _CHUNK + 1, dtype=np.uint64) * GOLDEN


def stream_keys(seed: int | None) -> Words:
    """The keys of a seed's streams, uint64: drift, detection, sampling of parameters, start.

    Args:
        seed: an integer >= 0; None uses entropy from the operating system.
    """
    state = np.random.SeedSequence(seed).generate_state(5, np.uint64)
    keys: Words = np.delete(state, _POLICY)
    return keys


def policy_key(seed: int) -> np.uint64:
    """The key of a policy's stream, which differs from the environment's for the same seed.

    Args:
        seed: an integer >= 0.
    """
    key: np.uint64 = np.random.SeedSequence(seed).generate_state(_POLICY + 1, np.uint64)[_POLICY]
    return key


def episode_keys(keys: Words, episodes: Words) -> Words:
    """The keys of episodes' sequences, uint64.

    Args:
        keys: the keys of the streams; broadcast with the episodes.
        episodes: the resets since the seed, from 0, uint64.
    """
    return mixed(keys + (episodes + _ONE) * GOLDEN)


def numbers(keys: Words, places: Words) -> Floats:
    """The uniforms in [0, 1) at given places in the sequences of given episodes, float64.

    Args:
        keys: the keys of the episodes, see `episode_keys`; broadcast with the places.
        places: indices in the sequences, from 0, uint64.
    """
    return unit_numbers(keys + (places + _ONE) * GOLDEN)


def unit_numbers(counters: Words) -> Floats:
    """The uniforms in [0, 1) of given counters, float64.

    Args:
        counters: the key of an episode plus `GOLDEN` times the place, counted from 1.
    """
    drawn: Floats = np.multiply(numerators(counters), _UNIT)
    return drawn


def numerators(counters: Words) -> Ints:
    """`unit_numbers` times `DENOMINATOR`, as integers: int64."""
    words = mixed(counters)
    words >>= _LOWEST_BITS
    return words.view(np.int64)


def mixed(words: Words) -> Words:
    """SplitMix64's mixing function; a new array."""
    shifted = np.right_shift(words, _SHIFTS[0])
    result = np.bitwise_xor(words, shifted)
    result *= _FACTORS[0]
    np.right_shift(result, _SHIFTS[1], out=shifted)
    result ^= shifted
    result *= _FACTORS[1]
    np.right_shift(result, _SHIFTS[2], out=shifted)
    result ^= shifted
    return result


class EpisodeStream:
    """One stream, read episode after episode: uniforms in [0, 1) as Python floats.

    Args:
        key: the key of the stream, see `stream_keys`.
    """

    def __init__(self, key: np.uint64) -> None:
        self._key = np.array([[key]])
        self._heads: list[list[float]] = []  # the first uniforms of several episodes
        self._heads_keys: list[int] = []  # the keys of those episodes
        self._heads_first = 0  # the first of those episodes
        self._episode = -1
        self._known: list[float] = []  # some uniforms of the episode, from this place on:
        self._first = 0
        self._drawn = 0
        self._rows: list[list[float]] = []
        self._first_row = 0

    def draw(self, episode: int, count: int) -> list[float]:
        """The next uniforms of an episode.

        Args:
            episode: the episode's number, from 0.
            count: the number of uniforms.
        """
        if episode != self._episode:
            self._begin(episode)
        begin = self._drawn
        self._drawn = end = begin + count
        if end > self._first + len(self._known):
            self._extend(begin, end)
        return self._known[begin - self._first : end - self._first]

    def row(self, episode: int, index: int, width: int) -> list[float]:
        """Row number `index` of an episode's uniforms, arranged in rows.

        Args:
            episode: the episode's number, as for `draw`.
            index: the row; never decreases within an episode.
            width: uniforms per row; constant within an episode.
        """
        if episode != self._episode:
            self._begin(episode)
        while index >= self._first_row + len(self._rows):
            self._first_row += len(self._rows)
            drawn = self.draw(episode, max(_SHORT[1] // width, 1) * width)
            self._rows = [drawn[i : i + width] for i in range(0, len(drawn), width)]
        return self._rows[index - self._first_row]

    def _begin(self, episode: int) -> None:
        if not 0 <= episode - self._heads_first < len(self._heads):
            # Assume that the next episodes are as long as the last one.
            count, width = _LONG if self._drawn > _SHORT[1] else _SHORT
            episodes = np.arange(episode, episode + count, dtype=np.uint64)
            keys = episode_keys(self._key, episodes[:, None])
            heads = numbers(keys, np.arange(width, dtype=np.uint64)).tolist()
            # After an interrupt between these lines, the heads are made again.
            self._heads = []
            self._heads_keys = keys[:, 0].tolist()
            self._heads_first = episode
            self._heads = heads
        self._known = self._heads[episode - self._heads_first]
        self._first = 0
        self._drawn = 0
        self._rows = []
        self._first_row = 0
        self._episode = episode

    def _extend(self, begin: int, end: int) -> None:
        """Compute at least the uniforms from one place to another."""
        self._known = self._known[begin - self._first :]
        self._first = begin
        key = self._heads_keys[self._episode - self._heads_first]
        for place in range(begin + len(self._known), end, _CHUNK):
            counter = np.uint64((key + place * int(GOLDEN)) % 2**64)
            self._known += unit_numbers(_NEXT + counter).tolist()


class Streams(NamedTuple):
    """The streams of an environment, one for each purpose.

    Attributes:
        drift: two uniforms per step and person, for the moves along x and y.
        detection: a row per step with one uniform per person, for searches.
        start: a uniform per person, for the hypothesis and the cell at step 0.
    """

    drift: EpisodeStream
    detection: EpisodeStream
    start: EpisodeStream

    @classmethod
    def from_seed(cls, seed: int | None) -> Streams:
        """The streams of a seed; without one, of entropy from the operating system."""
        drift, detection, _, start = stream_keys(seed)
        return cls(EpisodeStream(drift), EpisodeStream(detection), EpisodeStream(start))
