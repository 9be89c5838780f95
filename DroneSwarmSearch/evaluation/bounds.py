"""The upper bounds of searches, from a run's folder where it has them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.progress import Progress
from DroneSwarmSearch.evaluation.parallel import finished
from DroneSwarmSearch.evaluation.run_folder import RunFolder
from DroneSwarmSearch.evaluation.suite import NamedSearch
from DroneSwarmSearch.planning.bound import SuccessBound, success_bound

__all__ = ["bounds_of"]


def bounds_of(
    searches: Sequence[NamedSearch],
    folder: RunFolder | None = None,
    *,
    workers: int = 1,
    ray: str | None = None,
    progress: bool = True,
) -> dict[str, SuccessBound]:
    """The bounds of searches by name. They do not depend on `bayesian_update`.

    Args:
        searches: with different names.
        folder: where finished bounds are written and looked up.
        workers: see `evaluate`.
        ray: see `evaluate`.
        progress: see `evaluate`.
    """
    bounds: dict[str, SuccessBound] = {}
    for each in searches:
        found = None if folder is None else folder.load(_place(each))
        if found is not None:
            figures: dict[str, Any] = {
                key: array.item() for key, array in found.items() if key != "by_time"
            }
            bounds[each.name] = SuccessBound(by_time=found["by_time"], **figures)
    left = [each for each in searches if each.name not in bounds]
    calls = [partial(success_bound, each.scenario, each.drones) for each in left]
    what = f"bounds, {len(searches)} search{'es' * (len(searches) > 1)}"
    with Progress(what, len(left), progress) as bar:
        for done, (place, bound) in enumerate(finished(calls, workers=workers, ray=ray), 1):
            bounds[left[place].name] = bound
            if folder is not None:
                arrays = {name: np.asarray(value) for name, value in vars(bound).items()}
                folder.save(_place(left[place]), arrays)
            bar(done)
    return {each.name: bounds[each.name] for each in searches}


def _place(search: NamedSearch) -> str:
    return f"{search.name}.bound"
