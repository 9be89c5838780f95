"""Drift models, which compute where persons may be, and beliefs about them."""

from DroneSwarmSearch.drift.axes import dispersion_rate
from DroneSwarmSearch.drift.belief import Belief
from DroneSwarmSearch.drift.model import DriftModel
from DroneSwarmSearch.drift.models import drift_model
from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix

__all__ = ["Belief", "DriftModel", "ProbabilityMatrix", "dispersion_rate", "drift_model"]
