"""Persons to find, as plain data: what is known of their start, drift, detection and survival."""

from DroneSwarmSearch.persons.hypotheses import Drift
from DroneSwarmSearch.persons.person import Person
from DroneSwarmSearch.persons.tracks import Tracks

__all__ = ["Drift", "Person", "Tracks"]
