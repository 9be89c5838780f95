"""Tools for training scripts: a task, a learning curve, a comparison with baselines.

    while steps < total:
        ...
        training.log_row(folder / "curve.csv", steps=steps, found=success_rate)
    training.plot_curve(folder / "curve.csv")
    training.compare_with_baselines(policy, training.TRAINING_TASK, folder=folder)

The module is independent of any RL library.
"""

from DroneSwarmSearch.training.comparison import compare_with_baselines
from DroneSwarmSearch.training.curve import log_row, plot_curve
from DroneSwarmSearch.training.expected_searches import ExpectedSearches
from DroneSwarmSearch.training.task import TRAINING_TASK

__all__ = [
    "TRAINING_TASK",
    "ExpectedSearches",
    "compare_with_baselines",
    "log_row",
    "plot_curve",
]
