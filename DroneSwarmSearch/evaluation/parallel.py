"""Calls in this process, in processes on this machine, or on Ray, all through joblib."""

from __future__ import annotations

import contextlib
import importlib
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

from DroneSwarmSearch._internal import checks

__all__ = ["finished"]

JOBLIB_HINT = (
    "workers > 1 needs the package joblib: pip install 'DroneSwarmSearchEnvironment[evaluation]'"
)
RAY_HINT = "ray needs the package Ray: pip install 'DroneSwarmSearchEnvironment[ray]'"


def finished(
    calls: Sequence[partial[Any]], *, workers: int = 1, ray: str | None = None
) -> Iterator[tuple[int, Any]]:
    """Make calls, and yield the place and the result of each as it finishes.

    Args:
        calls: pickled if they run elsewhere.
        workers: the number of processes; 1 makes all calls in this process.
        ray: run on Ray: "local" for this machine, "auto" or the address of a cluster. All
            results are yielded when the last one is there.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: `workers` is less than 1.
        ImportError: joblib or Ray is needed and not installed.
        Exception: any exception that a call raises.
    """
    count = checks.integer("workers", workers, 1)
    if ray is not None and not isinstance(ray, str):
        raise TypeError(f"ray must be 'local', an address or None, got {ray!r:.100}")
    if (ray is None and count == 1) or not calls:
        for place, call in enumerate(calls):
            yield place, call()
        return
    joblib = _imported("joblib", JOBLIB_HINT)
    options: dict[str, Any] = {"n_jobs": count, "return_as": "generator_unordered"}
    with contextlib.ExitStack() as stack:
        if ray is not None:
            stack.enter_context(_ray_backend(joblib, ray))
            options = {"n_jobs": -1, "return_as": "list"}
        run = joblib.Parallel(batch_size=1, **options)
        yield from run(joblib.delayed(_numbered)(*each) for each in enumerate(calls))


def _numbered(place: int, call: Callable[[], Any]) -> tuple[int, Any]:
    return place, call()


@contextlib.contextmanager
def _ray_backend(joblib: Any, address: str) -> Iterator[None]:
    """Make Ray the backend of joblib; Ray is started, and stopped, if it was not running."""
    ray, backend = _imported("ray", RAY_HINT), _imported("ray.util.joblib", RAY_HINT)
    is_ours = not ray.is_initialized()
    if is_ours:
        ray.init(address=address, log_to_driver=False, logging_level="error")
    backend.register_ray()
    try:
        with joblib.parallel_config(backend="ray"):
            yield
    finally:
        if is_ours:
            ray.shutdown()


def _imported(name: str, hint: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(hint) from error
