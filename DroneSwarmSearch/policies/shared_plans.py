"""Plans that searches follow until a find, shared by all searches in the same situation."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

from DroneSwarmSearch.policies.belief_tracker import BeliefTracker
from DroneSwarmSearch.scenario import Cell

__all__ = ["HORIZON", "PlanMemory", "SharedPlans"]

HORIZON = 500
"""The most steps to plan at once, which bounds time and memory."""

CACHED_PLANS = 4096
"""The most plans to keep for other searches that reach the same situation."""

PlanT = TypeVar("PlanT")
MemoryT = TypeVar("MemoryT", bound="PlanMemory[Any]")


@dataclass
class PlanMemory(Generic[PlanT]):
    """A search and its plan.

    Attributes:
        tracker: the beliefs.
        plan: the plan; shared between searches, never changed.
        first: the step in which the plan begins.
        missing: the persons missing at that step.
        key: step, drones' cells and missing persons at every plan made in this search. With the
            scenario, they determine the plan.
    """

    tracker: BeliefTracker
    plan: PlanT | None = None
    first: int = 0
    missing: tuple[int, ...] = ()
    key: tuple[Any, ...] = ()

    def __deepcopy__(self: MemoryT, memo: dict[int, Any]) -> MemoryT:
        return replace(self, tracker=copy.deepcopy(self.tracker, memo))


class SharedPlans(Generic[PlanT]):
    """The plans made so far."""

    def __init__(self) -> None:
        self._plans: dict[tuple[Any, ...], PlanT] = {}

    def give(self, memory: PlanMemory[PlanT], cells: list[Cell], make: Callable[[], PlanT]) -> None:
        """Give a search a plan from its current step on.

        Args:
            memory: the search.
            cells: every drone's cell.
            make: makes the plan, unless another search had the same situations.
        """
        tracker = memory.tracker
        key = (*memory.key, tracker.step, tuple(cells), tracker.missing)
        if key not in self._plans:
            plan = make()
            if len(self._plans) == CACHED_PLANS:
                self._plans.clear()
            self._plans[key] = plan
        memory.plan, memory.key = self._plans[key], key
        memory.first, memory.missing = tracker.step, tracker.missing
