"""How persons drift, and where they may be: forecasts, sampled trajectories, beliefs."""

from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix, dispersion_rate

__all__ = ["ProbabilityMatrix", "dispersion_rate"]
