"""The library's own exceptions, and hints. Invalid arguments raise ValueError or TypeError."""

import difflib
from collections.abc import Iterable

import gymnasium


class ResetNeeded(gymnasium.error.ResetNeeded, RuntimeError):  # noqa: N818 (Gymnasium's name)
    """An environment was used before `reset`, or after the end of an episode."""


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """The end of a message about an unknown name: similar names, or nothing if there are none."""
    near = difflib.get_close_matches(name.lower(), names, cutoff=0.5)
    return f"; did you mean {' or '.join(near)}?" if near else ""
