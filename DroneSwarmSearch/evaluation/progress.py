"""How far a long piece of work has come: a bar, or a line now and then, on stderr."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Any

__all__ = ["Progress"]

PATIENCE = 2.0
"""Seconds before anything is shown."""

LINES_EVERY = 30.0
"""Seconds between lines where stderr is no terminal."""

HINT = "for a progress bar: pip install 'DroneSwarmSearchEnvironment[evaluation]'"

_hinted = False


class Progress:
    """Shows how much is done and how long the rest may take; a context manager.

    On a terminal it is a bar, drawn with rich and wiped away at the end; where rich is
    missing a hint comes once instead. Elsewhere it is a line every half minute. What takes
    less than two seconds shows nothing.

    Args:
        what: what is being done, in a few words.
        total: the whole amount of work, in whatever unit; more than 0.
        shown: False shows nothing at all.
        done: how much was done before, in another run; less than the total.
    """

    def __init__(self, what: str, total: float, shown: bool = True, done: float = 0.0) -> None:
        self._what = what
        self._total = total
        self._shown = shown
        self._before = done / total
        self._begun = self._told = time.monotonic()
        self._bar: Any = None

    def __enter__(self) -> Progress:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def __call__(self, done: float, note: str = "") -> None:
        """Tell how much is done.

        Args:
            done: from 0 to the whole amount, what was done before included.
            note: shown behind it, the latest figures for example.
        """
        now = time.monotonic()
        if not self._shown or now - self._begun < PATIENCE:
            return
        share = min(done / self._total, 1.0)
        left = _left(share, now - self._begun, self._before)
        left = f"{left}, {note}" if note else left
        if not sys.stderr.isatty():
            if now - self._told >= LINES_EVERY:
                self._told = now
                print(f"{self._what}: {share:.0%}, {left}", file=sys.stderr, flush=True)
            return
        if self._bar is None:
            self._bar = _bar(self._what)
        if self._bar is not None:
            self._bar.update(self._bar.task_ids[0], completed=share, left=left)


def _left(share: float, seconds: float, before: float = 0.0) -> str:
    """How long the rest will take if it goes on like this.

    Args:
        share: what is done of the whole.
        seconds: how long it took.
        before: a share that was done before, in none of these seconds.
    """
    if share <= before:
        return "time left unknown"
    left = round(seconds * (1.0 - share) / (share - before))
    if left >= 3600:
        return f"about {left // 3600} h {left % 3600 // 60:02} min left"
    return f"about {left // 60} min {left % 60:02} s left" if left >= 60 else f"about {left} s left"


def _bar(what: str) -> Any:
    """A bar of rich's, begun; None where rich is missing."""
    global _hinted
    try:
        from rich.console import Console
        from rich.progress import BarColumn, TextColumn
        from rich.progress import Progress as Bar
    except ImportError:
        if not _hinted:
            _hinted = True
            print(HINT, file=sys.stderr)
        return None
    bar = Bar(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TextColumn("{task.fields[left]}"),
        console=Console(stderr=True),
        transient=True,
    )
    bar.add_task(what, total=1.0, left="")
    bar.start()
    return bar
