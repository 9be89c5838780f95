"""Helpers for the tests of training examples, which run them as users do."""

import csv
import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType

from helpers import module_at

EXAMPLES = Path(__file__).parents[1] / "examples"

QUIET_RAY = {
    "RAY_DEFAULT_OBJECT_STORE_MAX_MEMORY_BYTES": "200000000",
    "RAY_ENABLE_UV_RUN_RUNTIME_ENV": "0",
    "RAY_USAGE_STATS_ENABLED": "0",
}


def module(name: str) -> ModuleType:
    """Import an example, which may import the files beside it."""
    if str(EXAMPLES) not in sys.path:
        sys.path.append(str(EXAMPLES))
    return module_at(EXAMPLES / f"{name}.py")


def run(name: str, *arguments: object) -> str:
    """Run an example, which must succeed; returns its output."""
    return python(EXAMPLES / f"{name}.py", *arguments)


def python(*arguments: object) -> str:
    """Run a program, which must succeed; returns its output."""
    done = subprocess.run(
        [sys.executable, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=600.0,
        check=False,
        env={**os.environ, **QUIET_RAY},
    )
    assert done.returncode == 0, done.stdout[-1000:] + done.stderr[-4000:]
    return done.stdout


def rows(path: Path) -> list[dict[str, str]]:
    """Read a CSV file."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))
