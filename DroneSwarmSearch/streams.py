"""Random numbers: a stream for each purpose, and in it a sequence for each episode.

The numbers of an episode depend on the seed, on the purpose and on how many resets
came since the seed, never on what the drones did: for one seed every policy meets the
same seas.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

__all__ = ["EpisodeStream", "Streams"]

# Episodes of untrained drones last a few steps, and a call of the generator costs more
# than they do: the first numbers of an episode are drawn for many episodes at once.
_HEAD = 16
_EPISODES = 32

# An odd number near 2**128 / golden ratio: the further numbers of successive episodes lie
# spread evenly over the generator's period, none near another's.
_STRETCH = 0x9E3779B97F4A7C15F39CC0605CEDC835


class EpisodeStream:
    """Uniform numbers in [0, 1) for one purpose.

    Args:
        seed: what the stream grows from.
    """

    def __init__(self, seed: np.random.SeedSequence) -> None:
        self._seed = seed
        self._heads_generator = np.random.PCG64DXSM(seed)
        self._heads: list[float] = []
        self._heads_number = -1
        self._episode = -1
        self._head: list[float] = []
        self._drawn = 0
        self._tail: np.random.Generator | None = None
        self._tail_episode = -1  # its stretch begins where the heads' numbers lie
        self._tail_drawn = 0
        self._rows: list[list[float]] = []
        self._first_row = 0

    def draw(self, episode: int, count: int) -> list[float]:
        """The next numbers of an episode.

        Args:
            episode: the episode's number, which never falls; 0 is the first.
            count: how many numbers.
        """
        if episode != self._episode:
            self._begin(episode)
        drawn = self._drawn
        self._drawn = end = drawn + count
        if end <= _HEAD:
            return self._head[drawn:end]
        numbers = self._head[drawn:]
        rest = count - len(numbers)
        tail = self._get_tail()
        self._tail_drawn += rest
        numbers += tail.random(rest).tolist()
        return numbers

    def row(self, episode: int, index: int, width: int) -> list[float]:
        """Row number `index` of an episode's numbers, laid out in rows.

        Args:
            episode: the episode's number, as for `draw`.
            index: the row; within an episode it never falls.
            width: numbers in a row; the same throughout an episode.
        """
        if episode != self._episode:
            self._begin(episode)
        while index >= self._first_row + len(self._rows):
            self._first_row += len(self._rows)
            numbers = self.draw(episode, max(_HEAD // width, 1) * width)
            self._rows = [numbers[i : i + width] for i in range(0, len(numbers), width)]
        return self._rows[index - self._first_row]

    def _begin(self, episode: int) -> None:
        number, place = divmod(episode, _EPISODES)
        if number != self._heads_number:
            size = _EPISODES * _HEAD
            self._heads_generator.advance((number - self._heads_number - 1) * size)
            self._heads = np.random.Generator(self._heads_generator).random(size).tolist()
            self._heads_number = number
        self._head = self._heads[place * _HEAD : (place + 1) * _HEAD]
        self._episode = episode
        self._drawn = 0
        self._rows = []
        self._first_row = 0

    def _get_tail(self) -> np.random.Generator:
        """The generator of the numbers beyond the head, at their place in the episode."""
        if self._tail is None:
            self._tail = np.random.Generator(np.random.PCG64DXSM(self._seed))
        if self._tail_episode != self._episode:
            stretches = self._episode - self._tail_episode
            advance = stretches * _STRETCH - self._tail_drawn
            self._tail.bit_generator.advance(advance)  # type: ignore[attr-defined]
            self._tail_episode = self._episode
            self._tail_drawn = 0
        return self._tail


class Streams(NamedTuple):
    """The streams of an environment, one for each purpose.

    Attributes:
        drift: moves the persons; for each step two numbers a person, for x and for y.
        detection: decides whether searches succeed; a row a step, a number a person.
    """

    drift: EpisodeStream
    detection: EpisodeStream

    @classmethod
    def from_seed(cls, seed: int | None) -> Streams:
        """Streams grown from a seed, or from the system's entropy without one."""
        drift, detection = np.random.SeedSequence(seed).spawn(2)
        return cls(EpisodeStream(drift), EpisodeStream(detection))
