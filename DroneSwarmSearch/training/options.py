"""Command-line options that the training examples share."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from DroneSwarmSearch._internal import checks

__all__ = ["arguments"]

EPISODES, SHORT_EPISODES = 1000, 50
"""Episodes of the final evaluation, without and with ``--short``."""


def arguments(description: str, *, steps: int, short: int) -> argparse.ArgumentParser:
    """Create a parser with the options of a training run; add your own to it.

    The options are `steps` (the total of environment steps, including those before a
    resume), `seed`, `out` (a folder), `resume`, `short`, `episodes` and
    `threads` (of PyTorch). ``--short`` lowers the defaults of steps and episodes.

    Args:
        description: a description of the script.
        steps: default number of environment steps; at least 1.
        short: the same with ``--short``; at least 1.

    Raises:
        TypeError: an argument has the wrong type.
        ValueError: a number is below 1.
    """
    defaults = {"steps": checks.integer("steps", steps, 1), "episodes": EPISODES}
    reduced = {"steps": checks.integer("short", short, 1), "episodes": SHORT_EPISODES}
    parser = _Parser(defaults, reduced, description)
    parser.add_argument(
        "--out",
        metavar="FOLDER",
        type=Path,
        required=True,
        help="folder for the checkpoint, curve.csv, curve.png and evaluation.csv",
    )
    parser.add_argument(
        "--steps",
        metavar="N",
        type=_at_least(1),
        help=f"total environment steps, including those before --resume ({steps:,})",
    )
    parser.add_argument(
        "--seed", metavar="S", type=_at_least(0), default=0, help="seed of the training (0)"
    )
    parser.add_argument(
        "--resume", action="store_true", help="continue from the checkpoint, if there is one"
    )
    parser.add_argument(
        "--short",
        action="store_true",
        help=f"a quick trial: {short:,} steps, {SHORT_EPISODES} episodes",
    )
    parser.add_argument(
        "--episodes",
        metavar="N",
        type=_at_least(1),
        help=f"episodes of the comparison with the baselines ({EPISODES:,})",
    )
    parser.add_argument(
        "--threads",
        metavar="N",
        type=_at_least(1),
        default=1,
        help="threads of PyTorch; for small networks, one is usually fastest (1)",
    )
    return parser


class _Parser(argparse.ArgumentParser):
    """A parser whose defaults depend on --short."""

    def __init__(self, defaults: dict[str, int], reduced: dict[str, int], description: str) -> None:
        super().__init__(
            description=description, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        self._full, self._reduced = defaults, reduced

    def parse_known_args(  # type: ignore[override] # the base class's is overloaded
        self, args: Sequence[str] | None = None, namespace: Any = None
    ) -> tuple[Any, list[str]]:
        options, rest = super().parse_known_args(args, namespace)
        for name, number in (self._reduced if options.short else self._full).items():
            if getattr(options, name) is None:
                setattr(options, name, number)
        return options, rest


def _at_least(low: int) -> Callable[[str], int]:
    """A type for `add_argument`: an integer of at least `low`."""

    def integer(text: str) -> int:
        try:
            return checks.integer("it", int(text.replace("_", "")), low)
        except ValueError:
            raise argparse.ArgumentTypeError(
                f"must be an integer of at least {low}, got {text!r}"
            ) from None

    return integer
