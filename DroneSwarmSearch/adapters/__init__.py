"""Adapters for RL libraries: one module per library, behind the extra of the same name.

Nothing else in the package imports them, and this module imports none of the libraries.
"""

from DroneSwarmSearch.adapters.trained_policy import TrainedPolicy

__all__ = ["TrainedPolicy"]
