"""Persons to find, as plain data: what is known of their start, drift, detection and survival."""

from DroneSwarmSearch.persons.hypotheses import Drift, Hypotheses
from DroneSwarmSearch.persons.known import KnownDrift
from DroneSwarmSearch.persons.markov import MarkovDrift
from DroneSwarmSearch.persons.person import Person
from DroneSwarmSearch.persons.tracks import TrackDrift, Tracks

__all__ = ["Drift", "Hypotheses", "KnownDrift", "MarkovDrift", "Person", "TrackDrift", "Tracks"]
