"""Write episodes to a file, for pages and scripts that play them without Python."""

from __future__ import annotations

import base64
import json
import os
import zlib
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import DroneSwarmSearch
from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.files import replacing, try_folder
from DroneSwarmSearch._internal.progress import progress
from DroneSwarmSearch.core.frame import Frame
from DroneSwarmSearch.core.named_search import NamedSearch
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.recording import play
from DroneSwarmSearch.evaluation.stage import prepared, view_of
from DroneSwarmSearch.evaluation.suite import as_named
from DroneSwarmSearch.layouts.view import View
from DroneSwarmSearch.rendering.palette import shares_of_maximum

Maps = dict[tuple[float, bytes], int]  # the number of each map, by its maximum and percentages


def export(
    policies: Iterable[object],
    search: object,
    path: str | os.PathLike[str],
    *,
    seeds: Iterable[int] = (0,),
    view: View | str | None = None,
) -> dict[str, Any]:
    """Write the episodes of some policies on a search as JSON, and return the content.

    These are the episodes that `evaluate` and `record` play with the same seeds. An existing
    file is only replaced when the new one is complete.

    The file is an object with these keys. Cells are numbers, y * grid_size + x. Lists over
    time begin with the state after `reset`, at step 0.

    - "format", "version": "DroneSwarmSearch episodes", 1; "package": this package's version.
    - "search": "name", "reason", "outline", "mission", "grid_size", "timestep_limit", start cells
      "drones", "metres_per_cell" and "seconds_per_step", which are null without a `Scale`.
    - "maps": every different map of the file. "count" is their number, "maxima" the probabilities
      of their likeliest cells. "data" holds all cells in percent of this maximum, as Base64 of
      zlib of uint8, shape (cells, count); each value is the difference, modulo 256, from the
      previous map, for the first map from zero.
    - "episodes": a list of objects, by policy, then by seed:

      - "policy", "seed", "steps"; "ending": the name of the `Ending` in lower case.
      - "actions": a string for each drone, with the number of an `Action` for each step.
      - "persons": for each, their "cells" until the episode ends or they are found, in the last
        one; and the number of the drone that found them, "found_by", or null.
      - "success": the probability of success of all searches so far, to four decimals.
      - "returns": the sum of all drones' rewards so far, to one decimal.
      - "prior", "posterior": the number of a map for each step, of the missing persons.

    Args:
        policies: a list of policies, each as for `evaluate`.
        search: the name of a search of the suite, a `NamedSearch`, or a `Scenario`.
        path: the file, .json.
        seeds: of the episodes of each policy, integers >= 0.
        view: what the policies see, as for `evaluate`.

    Raises:
        OSError: the file cannot be written.
        TypeError, ValueError: an argument is invalid.
    """
    target = checks.suffix("path", path, (".json",))
    where = as_named(search)
    specs = [PolicySpec.of(policy) for policy in policies]
    views = [view_of(spec, where, view) for spec in specs]
    chosen = [checks.integer("seeds", seed, 0) for seed in seeds]
    try_folder(target.parent)

    maps = Maps()
    episodes = []
    title = f"episodes of {where.name}"
    total = len(specs) * len(chosen)
    with replacing(target) as spare, progress(title, total) as bar:
        for spec, seen in zip(specs, views, strict=True):
            mine = where.with_posterior(seen.bayesian_update)
            policy = prepared(spec, mine)
            for seed in chosen:
                who = {"policy": spec.name, "seed": seed}
                episodes.append(who | _episode(list(play(policy, mine, seed, seen)), maps))
                bar(len(episodes))
        data = {
            "format": "DroneSwarmSearch episodes",
            "version": 1,  # of the format
            "package": DroneSwarmSearch.__version__,
            "search": _description(where),
            "maps": _packed(maps),
            "episodes": episodes,
        }
        text = json.dumps(data, separators=(",", ":"), allow_nan=False)
        spare.write_bytes(f"{text}\n".encode())
    return data


def _description(search: NamedSearch) -> dict[str, Any]:
    scenario = search.scenario
    scale = search.scale
    return {
        "name": search.name,
        "reason": search.reason,
        "outline": search.outline,
        "mission": scenario.mission,
        "grid_size": scenario.grid_size,
        "timestep_limit": scenario.timestep_limit,
        "drones": [y * scenario.grid_size + x for x, y in search.drones],
        "metres_per_cell": scale and scale.metres_per_cell,
        "seconds_per_step": scale and scale.seconds_per_step,
    }


def _episode(played: Sequence[tuple[Frame, tuple[int, ...]]], maps: Maps) -> dict[str, Any]:
    frames, actions = zip(*played, strict=True)
    last = frames[-1]
    persons = []
    for person, drone in enumerate(last.found_by):
        cells = [y * last.grid_size + x for x, y in (frame.persons[person] for frame in frames)]
        missing = sum(not frame.found[person] for frame in frames)
        persons.append({"cells": cells[: missing + 1], "found_by": drone})
    return {
        "ending": last.ending.name.lower() if last.ending else None,
        "steps": last.step,
        "actions": ["".join(map(str, chosen)) for chosen in zip(*actions[1:], strict=True)],
        "persons": persons,
        "success": [round(frame.probability_of_success or 0.0, 4) for frame in frames],
        "returns": [round(frame.total_return or 0.0, 1) for frame in frames],
        "prior": [_number(frame.prior, maps) for frame in frames],
        "posterior": [_number(frame.matrix, maps) for frame in frames],
    }


def _number(matrix: NDArray[np.float32], maps: Maps) -> int:
    """The number of a map; the next one if it differs from all before it."""
    percent = np.rint(shares_of_maximum(matrix) * 100).astype(np.uint8)
    return maps.setdefault((float(f"{matrix.max():.4g}"), percent.tobytes()), len(maps))


def _packed(maps: Maps) -> dict[str, Any]:
    every = np.stack([np.frombuffer(cells, np.uint8) for _, cells in maps], axis=1)
    differences = np.diff(every, axis=1, prepend=np.zeros((len(every), 1), np.uint8))
    packed = zlib.compress(differences.tobytes(), 9)
    return {
        "count": len(maps),
        "maxima": [most for most, _ in maps],
        "data": base64.b64encode(packed).decode("ascii"),
    }
