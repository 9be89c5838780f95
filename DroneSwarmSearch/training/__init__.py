"""Tools for training scripts: a task, a learning curve, a comparison with baselines.

The module is independent of any RL library.
"""

from DroneSwarmSearch.training.comparison import TRAINING_TASK, compare_with_baselines
from DroneSwarmSearch.training.curve import log_row, plot_curve
from DroneSwarmSearch.training.script import begin, finish

__all__ = ["TRAINING_TASK", "begin", "compare_with_baselines", "finish", "log_row", "plot_curve"]
