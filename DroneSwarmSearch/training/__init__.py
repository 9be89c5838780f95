"""Tools for training scripts: a task, a learning curve, a comparison with baselines.

The module is independent of any RL library.
"""

from DroneSwarmSearch.training.comparison import compare_with_baselines
from DroneSwarmSearch.training.curve import log_row, plot_curve
from DroneSwarmSearch.training.tasks import TASKS, TRAINING_TASK, Task

__all__ = [
    "TASKS",
    "TRAINING_TASK",
    "Task",
    "compare_with_baselines",
    "log_row",
    "plot_curve",
]
