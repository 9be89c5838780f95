"""What the tests of training examples share: running them as users do, and what they leave."""

from __future__ import annotations

import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType

from helpers import module_at

EXAMPLES = Path(__file__).parents[1] / "examples"

QUIET_RAY = {
    "RAY_DEFAULT_OBJECT_STORE_MAX_MEMORY_BYTES": "200000000",
    "RAY_ENABLE_UV_RUN_RUNTIME_ENV": "0",
    "RAY_USAGE_STATS_ENABLED": "0",
}

PATIENCE = 600.0
"""Seconds after which a test fails that waits for another process."""


def module(name: str) -> ModuleType:
    """An example as a module."""
    return module_at(EXAMPLES / f"{name}.py")


def run(name: str, *arguments: object) -> str:
    """What an example prints, in a process of its own, that must end well."""
    return python(EXAMPLES / f"{name}.py", *arguments)


def interrupt(name: str, folder: Path, moment: str, *arguments: object) -> None:
    """Stop an example by Ctrl-C, then do what it says: that must end well.

    Args:
        name: of the example.
        folder: of the run.
        moment: a pattern; Ctrl-C comes when a file or folder in the run's folder fits. If
            empty, it comes while the training is set up.
        arguments: of the example, for a short run.
    """
    command = [EXAMPLES / f"{name}.py", "--short", "--out", folder, *arguments]
    with subprocess.Popen(
        [sys.executable, *map(str, command), "--steps", str(10**9)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=_environment(),
        start_new_session=True,
    ) as process:
        until = time.monotonic() + PATIENCE
        while process.poll() is None and time.monotonic() < until:
            if any(folder.glob(moment)) if moment else folder.exists():
                break
            time.sleep(0.02)
        time.sleep(0.0 if moment else 0.2)  # the folder is made just before a run begins
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: Ray's processes, too
        _, told = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, told[-4000:]
    assert "Traceback" not in told, told[-4000:]
    if "interrupted before the first checkpoint" in told:
        python(*command)
    else:
        assert "--resume goes on from the last checkpoint" in told
        python(*command, "--resume")


def _environment() -> dict[str, str]:
    return {**os.environ, "OMP_NUM_THREADS": "1", **QUIET_RAY}


def python(*arguments: object) -> str:
    """What a program prints that must end well."""
    done = subprocess.run(
        [sys.executable, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
        env=_environment(),
    )
    assert done.returncode == 0, done.stdout[-1000:] + done.stderr[-4000:]
    return done.stdout


def rows(path: Path) -> list[dict[str, str]]:
    """A CSV file."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def check_folder(folder: Path, checkpoint: str | Path, policy: str) -> list[int]:
    """Check everything that a finished run leaves; returns the steps of the curve's rows."""
    curve = rows(folder / "curve.csv")
    known = [row for row in curve if row["reward"]]
    assert known and all(-1e5 - 100 * 50 <= float(row["reward"]) <= 2e5 for row in known)
    assert all(0 <= float(row["found"]) <= 1 for row in known)
    assert (folder / "curve.png").read_bytes().startswith(b"\x89PNG")
    assert (folder / checkpoint).stat().st_size > 1000
    evaluated = [row["policy"] for row in rows(folder / "evaluation.csv")]
    assert evaluated == [policy, "random", "greedy-matrix", "greedy-posterior"]
    steps = [int(row["steps"]) for row in curve]
    assert steps == sorted(set(steps))
    return steps


def check_table(output: str, policy: str, episodes: int) -> None:
    """Check that the comparison with the baselines was printed."""
    lines = output.splitlines()
    begun = [line.split()[0] for line in lines if line.strip()]
    place = begun.index(policy)
    assert begun[place + 1 : place + 4] == ["random", "greedy-matrix", "greedy-posterior"]
    assert f"{episodes} episodes, the same seas for all" in output
