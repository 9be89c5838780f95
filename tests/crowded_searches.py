"""Searches so small and so crowded that every ending is met often: shared by tests."""

from typing import Any

# So small and so crowded that every ending is met often.
SMALL: dict[str, Any] = {
    "grid_size": 4,
    "n_drones": 3,
    "vector": (0.3, -0.2),
    "person_initial_position": (2, 1),
    "timestep_limit": 9,
}


SEVERAL_PERSONS: dict[str, Any] = {
    **SMALL,
    "person_initial_position": [(2, 1), (1, 2)],
    "probability_of_detection": 0.7,
    "bayesian_update": True,
    "timestep_limit": 14,
}
