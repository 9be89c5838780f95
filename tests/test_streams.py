"""Streams of random numbers: the same for the same seed, whatever was drawn before."""

from __future__ import annotations

import copy
import itertools
import pickle

import numpy as np
import pytest

from DroneSwarmSearch.streams import EpisodeStream


def stream(seed: int = 1) -> EpisodeStream:
    return EpisodeStream(np.random.SeedSequence(seed))


def test_numbers_do_not_depend_on_the_portions_they_are_drawn_in() -> None:
    whole = stream().draw(0, 400)
    for portions in ([1] * 400, [16, 16, 32, 64, 272], [7, 393], [15, 2, 383]):
        parts = stream()
        assert list(itertools.chain.from_iterable(parts.draw(0, n) for n in portions)) == whole
    assert all(0 <= number < 1 for number in whole) and len(set(whole)) == 400


@pytest.mark.parametrize("drawn", [(0, 0, 0), (3, 1, 100), (500, 16, 17)])
def test_an_episode_does_not_depend_on_earlier_ones(drawn: tuple[int, ...]) -> None:
    numbers = stream()
    for episode, count in enumerate(drawn):
        if count:
            numbers.draw(episode, count)
    for episode in (3, 31, 32, 100):
        assert numbers.draw(episode, 60) == stream().draw(episode, 60)


def test_episodes_and_seeds_differ() -> None:
    numbers = stream()
    episodes = [tuple(numbers.draw(episode, 100)) for episode in range(70)]
    flat = list(itertools.chain.from_iterable(episodes))
    assert len(set(flat)) == len(flat)
    assert stream(2).draw(0, 100) != stream(1).draw(0, 100)


def test_numbers_are_uniform() -> None:
    numbers = stream()
    drawn = np.array([numbers.draw(episode, 40) for episode in range(2000)])
    # Means of 2000 uniform numbers, before and after the place where the head ends.
    assert np.abs(drawn.mean(axis=0) - 0.5).max() < 5 / np.sqrt(12 * 2000)
    # Successive episodes are uncorrelated.
    along = drawn - 0.5
    assert abs((along[1:] * along[:-1]).mean() * 12) < 5 / np.sqrt(along[1:].size)


def test_rows_are_the_draws_laid_out() -> None:
    for width in (1, 3, 16, 20):
        flat = stream().draw(2, 50 * width)
        rows = stream()
        assert rows.row(2, 0, width) == flat[:width]
        assert rows.row(2, 49, width) == flat[49 * width :]
        assert rows.row(2, 49, width) == flat[49 * width :]


@pytest.mark.parametrize("through", [copy.deepcopy, lambda s: pickle.loads(pickle.dumps(s))])
@pytest.mark.parametrize("drawn", [0, 5, 16, 90])
def test_copies_go_on_alike(through, drawn: int) -> None:
    numbers = stream()
    numbers.draw(4, drawn)
    twin = through(numbers)
    assert twin.draw(4, 50) == numbers.draw(4, 50)
    assert twin.draw(7, 50) == numbers.draw(7, 50)
