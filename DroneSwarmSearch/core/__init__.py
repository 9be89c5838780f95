"""The search: its parameters, its rules, and the state of an episode."""

from DroneSwarmSearch.core.collision_avoidance import choose_in_turn, resolve_conflicts
from DroneSwarmSearch.core.frame import Frame
from DroneSwarmSearch.core.grid import MOVES, OFF_GRID, Cell, Grid
from DroneSwarmSearch.core.mappings import Infos, Rewards
from DroneSwarmSearch.core.named_search import NamedSearch
from DroneSwarmSearch.core.rules import (
    Action,
    BatchEvents,
    Ending,
    RewardScheme,
    SearchRules,
    StepEvents,
    collisions,
    is_success,
    outcome,
    outcomes,
    same_cell,
    successes,
)
from DroneSwarmSearch.core.scenario import Scenario

__all__ = [
    "MOVES",
    "OFF_GRID",
    "Action",
    "BatchEvents",
    "Cell",
    "Ending",
    "Frame",
    "Grid",
    "Infos",
    "NamedSearch",
    "RewardScheme",
    "Rewards",
    "Scenario",
    "SearchRules",
    "StepEvents",
    "choose_in_turn",
    "collisions",
    "is_success",
    "outcome",
    "outcomes",
    "resolve_conflicts",
    "same_cell",
    "successes",
]
