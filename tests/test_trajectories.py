"""Trajectories of a person, and the confidence of a mean over a sample of them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_searches import all_trajectories

from DroneSwarmSearch.bound import chernoff_bound, enumerate_trajectories, sample_trajectories
from DroneSwarmSearch.drift import ProbabilityMatrix, drift_model
from DroneSwarmSearch.persons import Drift, Person, Tracks


class TestChernoff:
    @settings(max_examples=60, derandomize=True)
    @given(
        st.one_of(st.just(0.0), st.floats(1e-6, 1 - 1e-6)),
        st.integers(1, 10**6),
        st.floats(0.5, 0.9999),
    )
    def test_is_where_the_relative_entropy_reaches_its_limit(self, mean, count, confidence):
        p = chernoff_bound(mean, count, confidence)
        assert mean <= p <= 1.0
        allowed = -math.log(1 - confidence) / count

        def entropy(p: float) -> float:
            of_mean = mean * math.log(mean / p) if mean else 0.0
            return of_mean + (1 - mean) * math.log((1 - mean) / (1 - p))

        assert entropy(min(p + 1e-9, 1 - 1e-16)) >= allowed * (1 - 1e-6) or p > 1 - 1e-9
        assert entropy(max(p - 1e-9, mean)) <= allowed * (1 + 1e-6)

    @pytest.mark.parametrize("p", [0.03, 0.4, 0.9])
    def test_fails_at_most_with_the_stated_probability(self, p):
        n = 80
        confidence = 0.95
        failing = sum(
            math.comb(n, k) * p**k * (1 - p) ** (n - k)
            for k in range(n + 1)
            if chernoff_bound(k / n, n, confidence) < p
        )
        assert failing <= 1 - confidence


class TestTrajectories:
    FORECAST = ProbabilityMatrix(5, Drift((1, 3), vector=(0.4, -0.2), diffusion=0.41))

    def test_sampled_ones_are_distributed_as_the_forecast(self):
        count = 20_000
        trajectories = sample_trajectories(self.FORECAST, 12, count)
        assert enumerate_trajectories(self.FORECAST, 12) is None
        assert trajectories.cells.shape == (12, count)
        assert (trajectories.probabilities == 1 / count).all()
        for step in range(12):
            rates = np.bincount(trajectories.cells[step], minlength=25).reshape(5, 5) / count
            matrix = self.FORECAST.exact(step)
            error = np.sqrt(matrix * (1 - matrix) / count)
            assert (abs(rates - matrix) <= 4.5 * error + 1e-12).all()
        y, x = np.divmod(trajectories.cells, 5)
        assert max(abs(np.diff(x, axis=0)).max(), abs(np.diff(y, axis=0)).max()) == 1
        # From one cell in one step, the moves are those of the chain.
        here = trajectories.cells[5] == 13
        right, left, *_ = (chance[0, 3] for chance in self.FORECAST.moves(5))
        for move, chance in ((1, right), (-1, left)):
            rate = float(np.mean(x[6, here] - x[5, here] == move))
            assert abs(rate - chance) < 4 * math.sqrt(chance * (1 - chance) / here.sum())

    @pytest.mark.filterwarnings("ignore:3 tracks are few")
    def test_those_of_tracks_that_part(self):
        here = [(1.0, 1.0), (2.0, 1.0), (3.0, 1.0)]
        there = [(1.0, 1.0), (1.0, 2.0), (1.0, 3.0)]
        apart = [(4.0, 4.0), (4.0, 3.0), (4.0, 3.0)]
        tracks = Tracks(np.array([here, there, apart]).swapaxes(0, 1), [1, 2, 1])
        cells, chances = enumerate_trajectories(drift_model(Person(tracks).drift, 6), 3)
        assert cells.T.tolist() == [[7, 8, 9], [7, 13, 19], [28, 22, 22]]
        assert chances == pytest.approx([0.25, 0.5, 0.25])

    MIXTURES = (
        [Drift((0, 1), diffusion=0.2), Drift((4, 2), vector=(-0.5, 0.3), diffusion=0.1, weight=3)],
        [Drift(np.diag([3.0, 0, 0, 1, 0]), diffusion=0.3), Drift((2, 2), vector=(0, 0.2))],
        [Drift((1.5, 2), start_sd=(0.7, 0.0), vector=(0.2, 0), vector_sd=0.1)],
        [Drift((1, 2), vector=(0.2, 0.1), diffusion=0.02, adrift=4), Drift((3, 3), weight=0.2)],
    )

    @pytest.mark.parametrize("drifts", MIXTURES)
    def test_every_one_starts_with_a_hypothesis_and_a_cell(self, drifts):
        forecast = ProbabilityMatrix(5, Person(drifts))
        steps = 4
        trajectories = enumerate_trajectories(forecast, steps)
        assert trajectories is not None
        by_hand: dict[tuple[int, ...], float] = {}
        for path, probability in zip(*all_trajectories(forecast, steps), strict=True):
            by_hand[tuple(path)] = by_hand.get(tuple(path), 0.0) + probability
        enumerated: dict[tuple[int, ...], float] = {}
        for path, probability in zip(trajectories.cells.T, trajectories.probabilities, strict=True):
            enumerated[tuple(path)] = enumerated.get(tuple(path), 0.0) + probability
        assert enumerated == pytest.approx(by_hand, rel=1e-9, abs=1e-15)
        # Pairs of cells, at the first step and at the last, show the memory of the sample.
        count = 40_000
        first, *_, last = sample_trajectories(forecast, steps, count).cells
        rates = np.bincount(first * 25 + last, minlength=625) / count
        pairs = np.zeros(625)
        for path, probability in by_hand.items():
            pairs[path[0] * 25 + path[-1]] += probability
        error = np.sqrt(pairs * (1 - pairs) / count)
        assert (abs(rates - pairs) <= 4.5 * error + 1 / count).all()
