"""Upper bounds of searches, worked out here or on workers, and kept in a store."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

import numpy as np

from DroneSwarmSearch.evaluation.files import Store
from DroneSwarmSearch.evaluation.results import checked_bound
from DroneSwarmSearch.evaluation.suite import NamedSearch, as_named
from DroneSwarmSearch.evaluation.workers import Job, Report
from DroneSwarmSearch.planning.bound import SuccessBound, success_bound

__all__ = ["BoundOf"]


class BoundOf:
    """The upper bound of a search: the jobs to do, as in `run.EvaluationTask`, and then the result.

    Args:
        search: a name of the suite, a `NamedSearch`, or a `Scenario`. What the drones are
            shown, the posterior or not, makes no difference.
        store: where it is kept and looked for.

    Attributes:
        search: the search.
        bound: the bound, see `planning.success_bound`; None before the jobs are done.
    """

    WEIGHT = 10_000.0
    """Takes about as long as so many episodes, for progress."""

    def __init__(self, search: object, store: Store | None = None) -> None:
        self.search = as_named(search).with_posterior(False)
        self.bound: SuccessBound | None = None
        self._store = store

    def jobs(self) -> list[Job]:
        """What is left to do."""
        entry = None if self._store is None else self._store.load(self._key)
        try:
            self.bound = None if entry is None else self._from_entry(entry)
        except (TypeError, ValueError):
            self.bound = None
        if self.bound is not None:
            return []
        label = f"the bound of {self.search.name}"
        return [Job(label, _bound, (self.search,), weight=self.WEIGHT, then=self._take_in)]

    def _take_in(self, bound: SuccessBound) -> Iterable[Job]:
        self.bound = bound
        if self._store is not None:
            entry = {**asdict(bound), "by_time": bound.by_time.tolist()}
            self._store.save(self._key, entry)
        return ()

    def _from_entry(self, entry: dict[str, Any]) -> SuccessBound:
        """The bound that was kept; TypeError or ValueError if the entry holds none."""
        bound = SuccessBound(**{**entry, "by_time": np.array(entry.get("by_time"), np.float64)})
        checked_bound(bound, self.search)
        if not ((bound.by_time >= 0.0) & (bound.by_time <= 1.0)).all():
            raise ValueError("by_time must be probabilities")
        return bound

    @property
    def _key(self) -> dict[str, Any]:
        return {"what": "bound", "parameters": self.search.data}


def _bound(search: NamedSearch, report: Report) -> SuccessBound:
    return success_bound(search.scenario, search.drones, report=report)
