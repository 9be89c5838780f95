"""Tools for training scripts: a task, a learning curve, a comparison with baselines.

The module is independent of any RL library.
"""

from DroneSwarmSearch.training.comparison import TRAINING_TASK, compare_with_baselines
from DroneSwarmSearch.training.curve import log_row, plot_curve

__all__ = ["TRAINING_TASK", "compare_with_baselines", "log_row", "plot_curve"]
