"""The drift model of each kind of `KnownDrift`."""

from __future__ import annotations

import warnings
from functools import lru_cache, singledispatch

from DroneSwarmSearch.drift.chain import Chain
from DroneSwarmSearch.drift.markov import MarkovModel
from DroneSwarmSearch.drift.model import DriftModel
from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix
from DroneSwarmSearch.persons.hypotheses import Hypotheses
from DroneSwarmSearch.persons.known import KnownDrift
from DroneSwarmSearch.persons.markov import MarkovDrift
from DroneSwarmSearch.persons.tracks import TrackDrift

MOST_BEYOND = 0.01  # the share of tracks off the grid above which there is a warning


@singledispatch
def drift_model(known: KnownDrift, grid_size: int) -> DriftModel:
    """The drift model on a grid; register a function for each further kind of `KnownDrift`."""
    raise TypeError(f"no drift model is registered for {type(known).__name__}")


@drift_model.register
def _of_hypotheses(known: Hypotheses, grid_size: int) -> DriftModel:
    return ProbabilityMatrix(grid_size, known)


@drift_model.register
def _of_markov(known: MarkovDrift, grid_size: int) -> DriftModel:
    return _markov_model(known, grid_size)


@lru_cache(maxsize=16)
def _markov_model(known: MarkovDrift, grid_size: int) -> MarkovModel:
    """Equal chains share their tables."""
    return MarkovModel(known, grid_size)


@drift_model.register
def _of_tracks(known: TrackDrift, grid_size: int) -> DriftModel:
    key = (grid_size, known.fine, known.classes)
    chains = known.tracks.chains
    if key not in chains:
        steps = known.tracks.some_steps
        off = max(known.mass_beyond(grid_size, step) for step in steps)
        if off > MOST_BEYOND:
            warnings.warn(
                f"{off:.1%} of tracks leave the grid of {grid_size} x {grid_size} cells, "
                "and count as in its outer cells: take a larger grid, or larger cells",
                stacklevel=2,
            )
        chains[key] = Chain(known.tracks, *key)
    chain: DriftModel = chains[key]
    return chain
