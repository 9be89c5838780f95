"""The search on which the examples train: small enough to learn something in minutes."""

from __future__ import annotations

from typing import Any

__all__ = ["TRAINING_TASK"]

TRAINING_TASK: dict[str, Any] = {
    "grid_size": 10,
    "n_drones": 2,
    "vector": (0.2, 0.1),
    "person_initial_position": (4, 3),
    "disperse_constant": 5,
    "timestep_limit": 50,
    "bayesian_update": True,
}
"""Parameters of `DroneSwarmSearch`: two drones on a grid of 10 x 10, a person who drifts.

Drones without memory see where they have searched, since the matrix is the posterior.
"""
