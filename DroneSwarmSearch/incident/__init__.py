"""Incidents at sea: from a position in degrees to a plan that drones can fly.

An `Incident` is what a rescue centre knows; `plan` makes a `FlightPlan` of it, and `write` the
files for people and autopilots::

    from DroneSwarmSearch.incident import Incident, plan, write

    incident = Incident(
        position=("54-10.8N", "007-51.0E"),
        time="2026-03-01T05:30Z",
        object_class="LIFE-RAFT-SB-6",
        wind="300 20kn",
        current="160 0.5kn",
    )
    flight_plan = plan(incident)
    write(flight_plan, "plan")

On the command line, ``droneswarmsearch plan`` does the same.
"""

from DroneSwarmSearch.incident.coast import Coast
from DroneSwarmSearch.incident.drone import DroneInWind, drone_in_wind
from DroneSwarmSearch.incident.files import write
from DroneSwarmSearch.incident.fleet import Drone
from DroneSwarmSearch.incident.flight_plan import Alternative, FlightPlan
from DroneSwarmSearch.incident.flights import FlownFlight, Waypoint, read_flights
from DroneSwarmSearch.incident.hypothesis import Hypothesis
from DroneSwarmSearch.incident.incident import Incident
from DroneSwarmSearch.incident.on_grid import locate, search_on_grid
from DroneSwarmSearch.incident.particles import Particles, simulate
from DroneSwarmSearch.incident.patterns import KINDS, PARALLEL, SECTOR, SQUARE, Pattern
from DroneSwarmSearch.incident.planning import alternatives, begun_at_sea, plan
from DroneSwarmSearch.incident.sorties import after

__all__ = [
    "KINDS",
    "PARALLEL",
    "SECTOR",
    "SQUARE",
    "Alternative",
    "Coast",
    "Drone",
    "DroneInWind",
    "FlightPlan",
    "FlownFlight",
    "Hypothesis",
    "Incident",
    "Particles",
    "Pattern",
    "Waypoint",
    "after",
    "alternatives",
    "begun_at_sea",
    "drone_in_wind",
    "locate",
    "plan",
    "read_flights",
    "search_on_grid",
    "simulate",
    "write",
]
