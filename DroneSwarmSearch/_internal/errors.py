"""The library's own exceptions. Invalid arguments raise ValueError or TypeError."""

import gymnasium


class ResetNeeded(gymnasium.error.ResetNeeded, RuntimeError):  # noqa: N818 (Gymnasium's name)
    """An environment was used before `reset`, or after the end of an episode."""
