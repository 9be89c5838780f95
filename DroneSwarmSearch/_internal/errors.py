"""The library's own exceptions, hints for messages, and warnings of the commands.

Invalid arguments raise ValueError or TypeError.
"""

import difflib
import sys
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import gymnasium


class ResetNeeded(gymnasium.error.ResetNeeded, RuntimeError):  # noqa: N818 (Gymnasium's name)
    """An environment was used before `reset`, or after the end of an episode."""


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """The end of a message about an unknown name: similar names, or nothing if there are none."""
    near = difflib.get_close_matches(name.lower(), names, cutoff=0.5)
    return f"; did you mean {' or '.join(near)}?" if near else ""


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
