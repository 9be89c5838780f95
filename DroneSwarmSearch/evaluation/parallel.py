"""Calls in this process, in processes on this machine, or on Ray, all through joblib."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.extras import needed
from DroneSwarmSearch._internal.progress import progress


def finished(
    calls: Sequence[partial[Any]], what: str, workers: int, ray: str | None, visible: bool
) -> Iterator[Any]:
    """Make calls, show their progress, and yield their results in order.

    `workers` and `ray` are those of `evaluate`; calls elsewhere are pickled, and Ray's results come
    at the end.
    """
    count = checks.integer("workers", workers, 1)
    checks.boolean("progress", visible)
    with progress(what, len(calls), visible) as bar:
        results: Any = (call() for call in calls)
        if calls and (ray is not None or count > 1):
            joblib = needed("joblib", "workers > 1 needs the package joblib", "evaluation")
            options: dict[str, Any] = {"n_jobs": count, "return_as": "generator"}
            if ray is not None:
                _use_ray(ray)
                options = {"n_jobs": -1, "return_as": "list", "backend": "ray"}
            run = joblib.Parallel(batch_size=1, **options)
            results = run(joblib.delayed(call)() for call in calls)
        for done, result in enumerate(results, 1):
            bar(done)
            yield result


def _use_ray(address: str) -> None:
    """Make Ray a backend of joblib; Ray is started if it is not running."""
    modules = ("ray", "ray.util.joblib")
    ray, backend = (needed(name, "ray needs the package Ray", "ray") for name in modules)
    if not ray.is_initialized():
        ray.init(address=address, log_to_driver=False, logging_level="error")
    backend.register_ray()
