"""Layouts of observations for networks: what each drone is shown, as arrays.

The batched views and the PettingZoo wrappers show the same arrays by the same code. A
layout is one file here, and one line in `LAYOUTS`.
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
"""What each drone is shown, by the name of the layout."""

JOINT_LAYOUTS: dict[str, type[Layout]] = {
    "dict": JointDictLayout,
    "flat": JointFlatLayout,
    "planes": JointPlanesLayout,
}
"""What a swarm is shown as a whole; in the other layouts it is shown what its drones are."""
