"""Where a drifting person may be: persons, their drift models, and beliefs about them."""

from DroneSwarmSearch.drift.persons import Drift, Person
from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix
from DroneSwarmSearch.drift.tables import dispersion_rate
from DroneSwarmSearch.drift.tracks import Tracks

__all__ = ["Drift", "Person", "ProbabilityMatrix", "Tracks", "dispersion_rate"]
