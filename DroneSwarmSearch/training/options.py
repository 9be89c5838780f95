"""The options that all training examples have."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from DroneSwarmSearch._internal import checks

__all__ = ["arguments"]

EPISODES, FEW_EPISODES = 1000, 50
"""Of the evaluation, and of that of a short run."""


def arguments(description: str, *, steps: int, short: int) -> argparse.ArgumentParser:
    """A parser with the options of a training run; an example adds its own.

    Parsed, they are `steps` (environment steps to train, those of a resumed run
    included), `seed`, `out` (a folder), `resume`, `short` and `episodes`. With ``--short``,
    steps and episodes are few unless they are given.

    Args:
        description: what is trained, and how.
        steps: environment steps without ``--short``; at least 1.
        short: environment steps with ``--short``; at least 1.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: a number is below 1.
    """
    usual = {"steps": checks.integer("steps", steps, 1), "episodes": EPISODES}
    few = {"steps": checks.integer("short", short, 1), "episodes": FEW_EPISODES}
    parser = _Parser(usual, few, description)
    parser.add_argument(
        "--out",
        metavar="FOLDER",
        type=Path,
        required=True,
        help="gets the checkpoint, curve.csv, curve.png and evaluation.csv",
    )
    parser.add_argument(
        "--steps",
        metavar="N",
        type=_at_least(1),
        help=f"environment steps to train, earlier ones included ({steps:,})",
    )
    parser.add_argument(
        "--seed", metavar="S", type=_at_least(0), default=0, help="of the training (0)"
    )
    parser.add_argument(
        "--resume", action="store_true", help="go on from the checkpoint in the folder"
    )
    parser.add_argument(
        "--short",
        action="store_true",
        help=f"try everything shortly: {short:,} steps, {FEW_EPISODES} episodes",
    )
    parser.add_argument(
        "--episodes",
        metavar="N",
        type=_at_least(1),
        help=f"on which the result is compared with the baselines ({EPISODES:,})",
    )
    return parser


class _Parser(argparse.ArgumentParser):
    """Fills in what depends on --short."""

    def __init__(self, usual: dict[str, int], few: dict[str, int], description: str) -> None:
        super().__init__(
            description=description, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        self._usual, self._few = usual, few

    def parse_known_args(  # type: ignore[override] # the base class's is overloaded
        self, args: Sequence[str] | None = None, namespace: Any = None
    ) -> tuple[Any, list[str]]:
        options, rest = super().parse_known_args(args, namespace)
        for name, number in (self._few if options.short else self._usual).items():
            if getattr(options, name) is None:
                setattr(options, name, number)
        return options, rest


def _at_least(low: int) -> Callable[[str], int]:
    """What reads an integer of at least `low`."""

    def integer(text: str) -> int:
        try:
            return checks.integer("it", int(text.replace("_", "")), low)
        except ValueError:
            raise argparse.ArgumentTypeError(
                f"must be an integer of at least {low}, got {text!r}"
            ) from None

    return integer
