"""Observation layouts by name, as arrays; the vector environments and the wrappers use the same.

A new layout is a class in a file of this folder, a line in `LAYOUTS`, and a class in `wrappers`.
"""

from __future__ import annotations

from DroneSwarmSearch.layouts.crops import CropsLayout
from DroneSwarmSearch.layouts.layout import Layout, mask_space, remaining_time_fraction
from DroneSwarmSearch.layouts.top_cells import TopCellsLayout
from DroneSwarmSearch.layouts.whole_matrix import DictLayout, FlatLayout, PlanesLayout

__all__ = [
    "JOINT_LAYOUTS",
    "LAYOUTS",
    "CropsLayout",
    "Layout",
    "TopCellsLayout",
    "mask_space",
    "remaining_time_fraction",
]

LAYOUTS: dict[str, type[Layout]] = {
    "dict": DictLayout,
    "flat": FlatLayout,
    "planes": PlanesLayout,
    "top-cells": TopCellsLayout,
    "crops": CropsLayout,
}
"""The layouts of single drones, by name."""

JOINT_LAYOUTS = ("dict", "flat", "planes")
"""Those that take `joint`, to show whole swarms; of others, a swarm's observations are stacked."""
