"""Progress of long work on stderr: a line that changes on a terminal, otherwise a few lines."""

from __future__ import annotations

import shutil
import sys
import time
from datetime import timedelta

SILENT = 2.0  # seconds before anything is shown
REDRAW_EVERY, LINES_EVERY = 0.2, 30.0  # seconds, on a terminal and elsewhere
WIDTH = 30  # characters in a full bar


class Progress:
    """Shows the share of an amount of work done, and the time left; a context manager.

    On a terminal it shows a bar, and removes it at the end. Otherwise it prints a line every half
    minute. Work of less than two seconds shows nothing.
    """

    def __init__(self, what: str, total: float, shown: bool = True) -> None:
        self._what = what
        self._total = total
        self._shown = shown
        self._start = self._last = time.monotonic()
        self._has_bar = False

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *error: object) -> None:
        if self._has_bar:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
            self._has_bar = False

    def __call__(self, done: float) -> None:
        """Show the amount done."""
        now, is_terminal = time.monotonic(), sys.stderr.isatty()
        pause = REDRAW_EVERY if is_terminal else LINES_EVERY
        if not self._shown or now - self._start < SILENT or now - self._last < pause:
            return
        self._last = now
        share = min(done / self._total, 1.0)
        left = (now - self._start) * (1 / share - 1) if share else 0.0
        text = f"{share:.0%}, {timedelta(seconds=round(left)) if share else 'unknown time'} left"
        if is_terminal:
            self._has_bar = True
            bar = f"[{'#' * round(share * WIDTH):{WIDTH}}]"
            line = f"{self._what} {bar} {text}"[: shutil.get_terminal_size().columns - 1]
            print(f"\r{line}\x1b[K", end="", file=sys.stderr, flush=True)
        else:
            print(f"{self._what}: {text}", file=sys.stderr, flush=True)
