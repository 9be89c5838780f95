"""Where a drifting person may be: persons, their drift models, and beliefs about them."""

from DroneSwarmSearch.drift.axes import dispersion_rate
from DroneSwarmSearch.drift.hypotheses import Drift
from DroneSwarmSearch.drift.persons import Person
from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix
from DroneSwarmSearch.drift.tracks import Tracks

__all__ = ["Drift", "Person", "ProbabilityMatrix", "Tracks", "dispersion_rate"]
