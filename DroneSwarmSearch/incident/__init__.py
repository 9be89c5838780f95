"""Incidents at sea: from a position in degrees to a plan that drones can fly.

An `Incident` is what a rescue centre knows, and `Incident.plan` returns a `FlightPlan`::

    from DroneSwarmSearch.incident import Incident

    incident = Incident(
        position=("54-10.8N", "007-51.0E"),
        time="2026-03-01T05:30Z",
        object_class="LIFE-RAFT-SB-6",
        wind="300 20kn",
        current="160 0.5kn",
    )
    plan = incident.plan()
    plan.save("plan")

On the command line, ``droneswarmsearch plan`` does the same.
"""

from DroneSwarmSearch.incident.flight_plan import FlightPlan
from DroneSwarmSearch.incident.flights import FlownFlight, Waypoint
from DroneSwarmSearch.incident.incident import Incident
from DroneSwarmSearch.incident.patterns import Pattern

__all__ = ["FlightPlan", "FlownFlight", "Incident", "Pattern", "Waypoint"]
