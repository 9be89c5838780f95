"""Places, units, times and flows on the earth."""

from DroneSwarmSearch.geo.plane import TangentPlane
from DroneSwarmSearch.geo.scale import Scale
from DroneSwarmSearch.geo.units import KNOT, current_towards, wind_from

__all__ = ["KNOT", "Scale", "TangentPlane", "current_towards", "wind_from"]
