"""Progress of long work as a bar of tqdm (the extra "evaluation"); nothing without it."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator

FORMAT = "{desc}: {percentage:3.0f}%|{bar}| {remaining} left"


@contextlib.contextmanager
def progress(what: str, total: float, visible: bool = True) -> Iterator[Callable[[float], None]]:
    """Yield a function to call with the amount of work done so far.

    On a terminal, a bar on stderr appears after two seconds, and disappears at the end.
    """
    try:
        from tqdm import tqdm
    except ImportError:
        yield lambda done: None
        return
    # None: unless stderr is a terminal. It may be closed, or replaced by None.
    is_disabled = True if not visible or sys.stderr is None else None
    with tqdm(
        total=total, desc=what, leave=False, delay=2.0, bar_format=FORMAT, disable=is_disabled
    ) as bar:
        yield lambda done: bar.update(done - bar.n)
