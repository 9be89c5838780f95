"""The task that the training examples share: small enough to learn in minutes."""

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
"""Parameters of `DroneSwarmSearch`: two drones search a 10 x 10 grid for a drifting person.

The matrix is the posterior, so a policy without memory sees where the drones have searched.
"""
