"""Observations as position and matrix, by name."""

from __future__ import annotations

from typing import Any

from pettingzoo import ParallelEnv

from DroneSwarmSearch.wrappers.layout_observation import LayoutObservation
from DroneSwarmSearch.wrappers.layouts.dictionary import DictLayout

__all__ = ["DictObservation"]


class DictObservation(LayoutObservation):
    """Shows each drone {"position": (x, y), "probability_matrix": matrix}.

    The position is int32, shape (2,); the matrix float32, shape (N, N), indexed [y, x],
    summing to 1.

    Args:
        env: the environment.

    Raises:
        TypeError: `env` is no `DroneSwarmSearch` and no wrapper of one.
        ValueError: it has masks in its observations.
    """

    def __init__(self, env: ParallelEnv[str, Any, int]) -> None:
        super().__init__(env, DictLayout)
