"""Positions, units, times and flows on the earth."""

from DroneSwarmSearch.geo.coast import Land, land_around
from DroneSwarmSearch.geo.fields import Field
from DroneSwarmSearch.geo.flows import Constant, Flow, Origin, Series
from DroneSwarmSearch.geo.plane import TangentPlane
from DroneSwarmSearch.geo.scale import Scale
from DroneSwarmSearch.geo.typed_flows import read_flow
from DroneSwarmSearch.geo.units import KNOT, current_towards, wind_from

__all__ = [
    "KNOT",
    "Constant",
    "Field",
    "Flow",
    "Land",
    "Origin",
    "Scale",
    "Series",
    "TangentPlane",
    "current_towards",
    "land_around",
    "read_flow",
    "wind_from",
]
