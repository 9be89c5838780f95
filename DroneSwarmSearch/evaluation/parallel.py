"""Calls in this process, in processes on this machine, or on Ray, all through joblib."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.extras import needed
from DroneSwarmSearch._internal.progress import progress


@dataclass(frozen=True)
class Workers:
    """Where calls run, and whether their progress is shown; see `evaluate`.

    Attributes:
        workers: the number of processes on this machine.
        ray: "local", "auto" or the address of a Ray cluster, in place of these.
        progress: whether a terminal shows a bar.
    """

    workers: int = 1
    ray: str | None = None
    progress: bool = True

    def __post_init__(self) -> None:
        checks.integer("workers", self.workers, 1)
        checks.boolean("progress", self.progress)

    def finished(self, calls: Sequence[partial[Any]], what: str) -> Iterator[Any]:
        """Make calls, and yield their results in order.

        Calls elsewhere are pickled. Ray's results come at the end. `what` is the title of the bar.
        """
        with progress(what, len(calls), self.progress) as bar:
            for done, result in enumerate(self._results(calls), 1):
                bar(done)
                yield result

    def _results(self, calls: Sequence[partial[Any]]) -> Iterator[Any]:
        if not calls or (self.ray is None and self.workers == 1):
            return (call() for call in calls)
        joblib = needed("joblib", "workers > 1 needs the package joblib", "evaluation")
        options: dict[str, Any] = {"n_jobs": self.workers, "return_as": "generator"}
        if self.ray is not None:
            _use_ray(self.ray)
            options = {"n_jobs": -1, "return_as": "list", "backend": "ray"}
        run = joblib.Parallel(batch_size=1, **options)
        return iter(run(joblib.delayed(call)() for call in calls))


def _use_ray(address: str) -> None:
    """Make Ray a backend of joblib; Ray is started if it is not running."""
    modules = ("ray", "ray.util.joblib")
    ray, backend = (needed(name, "ray needs the package Ray", "ray") for name in modules)
    if not ray.is_initialized():
        ray.init(address=address, log_to_driver=False, logging_level="error")
    backend.register_ray()
