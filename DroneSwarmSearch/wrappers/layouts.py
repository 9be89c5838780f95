"""All observation layouts by name; the vector environments and the wrappers use the same.

A new layout is a class in a file of this folder, next to its wrapper, and a line in `LAYOUTS`.
"""

from __future__ import annotations

from DroneSwarmSearch.wrappers.crops import CropsLayout
from DroneSwarmSearch.wrappers.dictionary import DictLayout, JointDictLayout
from DroneSwarmSearch.wrappers.flat import FlatLayout, JointFlatLayout
from DroneSwarmSearch.wrappers.layout import Layout, StackedLayout, remaining_time_fraction
from DroneSwarmSearch.wrappers.planes import JointPlanesLayout, PlanesLayout
from DroneSwarmSearch.wrappers.top_cells import TopCellsLayout

__all__ = ["JOINT_LAYOUTS", "LAYOUTS", "Layout", "StackedLayout", "remaining_time_fraction"]

LAYOUTS: dict[str, type[Layout]] = {
    "dict": DictLayout,
    "flat": FlatLayout,
    "planes": PlanesLayout,
    "top-cells": TopCellsLayout,
    "crops": CropsLayout,
}
"""The layouts of single drones, by name."""

JOINT_LAYOUTS: dict[str, type[Layout]] = {
    "dict": JointDictLayout,
    "flat": JointFlatLayout,
    "planes": JointPlanesLayout,
}
"""The layouts of whole swarms; for other names, the drones' observations are stacked."""
