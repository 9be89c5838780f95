"""What the commands print besides their results."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def printed_warnings(prefix: str = "") -> Iterator[None]:
    """Print warnings to stderr as plain lines, each once, without the source.

    Args:
        prefix: precedes every warning's text.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    for text in dict.fromkeys(str(each.message) for each in caught):
        print(f"warning: {prefix}{text}", file=sys.stderr)
