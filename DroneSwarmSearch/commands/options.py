"""Options that may be given once."""

from __future__ import annotations

import argparse
from typing import Any


class Once(argparse.Action):
    """Stores a value, as `argparse` does by default, but refuses to replace one silently.

    What was typed is in the namespace's `given`, by destination.
    """

    def __call__(self, parser: Any, namespace: Any, values: Any, option_string: Any = None) -> None:
        given: dict[str, Any] = namespace.given
        if option_string is not None and self.dest in given:
            raise argparse.ArgumentError(
                self, f"must be given once, got {_shown(given[self.dest])} and {_shown(values)}"
            )
        given[self.dest] = values
        setattr(namespace, self.dest, values)


def add_parser(several: Any, name: str, **options: Any) -> argparse.ArgumentParser:
    """Add the parser of a command, whose options may all be given once unless they are lists."""
    parser: argparse.ArgumentParser = several.add_parser(name, **options)
    for action in (None, "store"):
        parser.register("action", action, Once)
    parser.set_defaults(given={})
    return parser


def _shown(value: Any) -> str:
    """A value as it was typed."""
    return " ".join(map(str, value)) if isinstance(value, list) else str(value)
