"""Adapters for RL libraries: one module per library, behind the extra of the same name.

The package imports them only to read a saved model; this module imports none of the libraries.
"""

from DroneSwarmSearch.adapters.trained_policy import TrainedPolicy

__all__ = ["TrainedPolicy"]
