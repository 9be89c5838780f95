"""Helpers for the tests of training examples: run them as users do, and check the results."""

from __future__ import annotations

import csv
import os
import re
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

TIMEOUT = 600.0
"""Seconds to wait for another process."""


def module(name: str) -> ModuleType:
    """Import an example."""
    return module_at(EXAMPLES / f"{name}.py")


def run(name: str, *arguments: object) -> str:
    """Run an example, which must succeed; returns its output."""
    return python(EXAMPLES / f"{name}.py", *arguments)


def interrupt(name: str, folder: Path, moment: str, *arguments: object) -> None:
    """Stop an example with Ctrl-C, then follow the advice that it prints; that must succeed.

    Args:
        name: of the example.
        folder: of the run.
        moment: a pattern; Ctrl-C is sent once a file or folder in the run's folder matches.
            If empty, it is sent while the training is set up.
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
        until = time.monotonic() + TIMEOUT
        while process.poll() is None and time.monotonic() < until:
            if any(folder.glob(moment)) if moment else folder.exists():
                break
            time.sleep(0.02)
        time.sleep(0.0 if moment else 0.2)  # the folder is made just before a run starts
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does, including Ray's processes
        _, errors = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 130, errors[-4000:]
    # An interrupt in a callback that cannot raise is printed, and raised by the next callback.
    reported = re.sub(r"Exception ignored in.*?KeyboardInterrupt: ?\n", "", errors, flags=re.S)
    assert "Traceback" not in reported, errors[-4000:]
    if "interrupted before the first checkpoint" in errors:
        python(*command)
    else:
        assert "--resume continues from the last checkpoint" in errors
        python(*command, "--resume")


def python(*arguments: object) -> str:
    """Run a program, which must succeed; returns its output."""
    done = subprocess.run(
        [sys.executable, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        check=False,
        env=_environment(),
    )
    assert done.returncode == 0, done.stdout[-1000:] + done.stderr[-4000:]
    return done.stdout


def _environment() -> dict[str, str]:
    return {**os.environ, "OMP_NUM_THREADS": "1", **QUIET_RAY}


def rows(path: Path) -> list[dict[str, str]]:
    """Read a CSV file."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def check_folder(folder: Path, checkpoint: str | Path, policy: str) -> list[int]:
    """Check the files of a finished run; returns the steps of the curve's rows.

    Args:
        folder: of the run.
        checkpoint: a file of the newest checkpoint, or a pattern for it.
        policy: name of the trained policy.
    """
    curve = rows(folder / "curve.csv")
    known = [row for row in curve if row["reward"]]
    assert known and all(-1e5 - 100 * 50 <= float(row["reward"]) <= 2e5 for row in known)
    assert all(0 <= float(row["found"]) <= 1 for row in known)
    assert (folder / "curve.png").read_bytes().startswith(b"\x89PNG")
    (saved,) = folder.glob(str(checkpoint))
    assert saved.stat().st_size > 1000
    evaluated = [row["policy"] for row in rows(folder / "evaluation.csv")]
    assert evaluated == [policy, "random", "greedy-matrix", "greedy-posterior"]
    steps = [int(row["steps"]) for row in curve]
    assert steps == sorted(set(steps))
    return steps


def check_table(output: str, policy: str, episodes: int) -> None:
    """Check that the comparison with the baselines is printed."""
    words = [line.split()[0] for line in output.splitlines() if line.strip()]
    place = words.index(policy)
    assert words[place + 1 : place + 4] == ["random", "greedy-matrix", "greedy-posterior"]
    assert f"{episodes} episodes, the same for all policies" in output
