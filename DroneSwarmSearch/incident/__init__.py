"""Incidents at sea: from a position in degrees to a plan that drones can fly.

An `Incident` is what a rescue centre knows, and `Incident.plan` returns a `FlightPlan`::

    from DroneSwarmSearch.incident import Incident
    from DroneSwarmSearch.leeway import KNOT, current_towards, wind_from

    incident = Incident(
        position=(54.18, 7.85),
        time="2026-03-01T05:30Z",
        object_class="LIFE-RAFT-SB-6",
        wind=wind_from(300, 25 * KNOT),
        current=current_towards(160, 0.5 * KNOT),
    )
    plan = incident.plan()
    plan.save("plan")

On the command line, ``droneswarmsearch plan`` does the same.
"""

from DroneSwarmSearch.incident.flight_plan import FlightPlan
from DroneSwarmSearch.incident.flights import Waypoint
from DroneSwarmSearch.incident.report import Incident

__all__ = ["FlightPlan", "Incident", "Waypoint"]
