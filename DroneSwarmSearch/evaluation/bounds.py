"""Compute the upper bounds of searches as jobs, and store them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.evaluation.results import bound_data, checked_bound
from DroneSwarmSearch.evaluation.store import Store
from DroneSwarmSearch.evaluation.suite import NamedSearch, as_named
from DroneSwarmSearch.evaluation.workers import Job, Report
from DroneSwarmSearch.planning.bound import SuccessBound, success_bound

__all__ = ["BoundTask"]


class BoundTask:
    """The upper bound of a search, to be computed by `run_tasks`.

    Args:
        search: the name of a search of the suite, a `NamedSearch`, or a `Scenario`. Its
            `bayesian_update` has no effect on the bound.
        store: where the bound is stored and looked up.

    Attributes:
        search: the search.
        bound: the bound, see `planning.success_bound`; None until the jobs are done.
        weight: the work left, in episodes that take as long.
    """

    WEIGHT = 10_000.0

    def __init__(self, search: object, store: Store | None = None) -> None:
        self.search = as_named(search).with_posterior(False)
        self.bound: SuccessBound | None = None
        self.weight = self.WEIGHT
        self._store = store

    def jobs(self) -> list[Job]:
        """Return the jobs that are left."""
        entry = None if self._store is None else self._store.load(self._key)
        try:
            self.bound = None if entry is None else self._from_entry(entry)
        except (TypeError, ValueError):
            self.bound = None
        if self.bound is not None:
            self.weight = 0.0
            return []
        label = f"the bound of {self.search.name}"
        return [Job(label, _bound, (self.search,), weight=self.WEIGHT, then=self._finish)]

    def _finish(self, bound: SuccessBound) -> Iterable[Job]:
        self.bound = bound
        if self._store is not None:
            self._store.save(self._key, bound_data(bound))
        return ()

    def _from_entry(self, entry: dict[str, Any]) -> SuccessBound:
        """Read a stored bound; raises TypeError or ValueError if the entry is damaged."""
        bound = SuccessBound(**{**entry, "by_time": np.array(entry.get("by_time"), np.float64)})
        checked_bound(bound, self.search)
        figures = {**entry, "by_time": 0.0}
        if not all(map(checks.is_number, figures.values())):
            raise TypeError("all figures must be numbers")
        if not ((bound.by_time >= 0.0) & (bound.by_time <= 1.0)).all():
            raise ValueError("by_time must be probabilities")
        return bound

    @property
    def _key(self) -> dict[str, Any]:
        return {"what": "bound", "parameters": self.search.data}


def _bound(search: NamedSearch, report: Report) -> SuccessBound:
    return success_bound(search.scenario, search.drones, report=report)
