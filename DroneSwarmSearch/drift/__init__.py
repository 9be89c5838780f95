"""Where a drifting person may be: the forecast, the sampled trajectory, the posterior."""

from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix
from DroneSwarmSearch.drift.tables import dispersion_rate

__all__ = ["ProbabilityMatrix", "dispersion_rate"]
