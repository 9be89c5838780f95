"""The memory that a large batch takes, measured in a process of its own."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import DroneSwarmSearch
from DroneSwarmSearch.bench.cases import INDEX, LeftOutError, Size

__all__ = ["Figures", "measure"]

Figures = dict[str, Any]

_SCRIPT = "from DroneSwarmSearch.bench import memory; memory.play_and_tell()"


def measure(size: Size, num_envs: int, steps: tuple[int, int]) -> Figures:
    """The peak memory of a batch by index, after so many steps and after so many more.

    Raises:
        LeftOutError: the system does not tell the memory of processes.
    """
    if _peak() is None:
        raise LeftOutError("the system does not tell the memory of processes")
    places = [str(Path(DroneSwarmSearch.__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
    wanted = {"size": size, "num_envs": num_envs, "steps": steps}
    done = subprocess.run(
        [sys.executable, "-c", _SCRIPT, json.dumps(wanted)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, places))},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    before, first, last = json.loads(done.stdout)
    return {
        "grid_size": size.grid_size,
        "n_drones": size.n_drones,
        "num_envs": num_envs,
        "steps": list(steps),
        "peak_mib_before": before,
        "peak_mib": first,
        "growth_mib": last - first,
    }


def play_and_tell() -> None:
    """What the process does: print the peak before the batch and after either steps."""
    wanted = json.loads(sys.argv[1])
    peaks = [_peak()]
    run = INDEX.make(Size(*wanted["size"]), wanted["num_envs"])
    first, last = wanted["steps"]
    for steps in (first, last - first):
        run(steps)
        peaks.append(_peak())
    print(json.dumps(peaks))


def _peak() -> float | None:
    """The most memory that this process has ever held, in MiB, if the system tells it."""
    # Of the two, getrusage on Linux counts what a process was before it became this one:
    # a copy of its parent, which may hold far more.
    status = Path("/proc/self/status")
    if status.exists():
        held = re.search(r"^VmHWM:\s+(\d+) kB$", status.read_text("ascii", "replace"), re.M)
        if held is not None:
            return int(held[1]) / 2**10
    try:
        import resource
    except ImportError:
        return None
    unit = 2**20 if sys.platform == "darwin" else 2**10
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
