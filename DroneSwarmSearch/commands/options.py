"""Options that may be given once, and errors that name them as they are typed."""

from __future__ import annotations

import argparse
import re
from typing import Any

PARAMETER = re.compile(
    r"^\w+(?=[ \[:,])"
    r"|(?:(?<=together with )|(?<=needs )|(?<=before ))\w+(?=[ ,;]|$)"
    r"|(?<![\w.-])[a-z]+(?:_[a-z]+)+(?![\w.(])"
)
"""Where a message may name a parameter: it begins with one, or with an underscore it is no word."""


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
    """Add the parser of a command, whose options may all be given once unless they are lists.

    Its default `names` is for the parameters of functions that users do not type as `as_typed`
    expects: what they type, by the parameter.
    """
    parser: argparse.ArgumentParser = several.add_parser(name, **options)
    for action in (None, "store"):
        parser.register("action", action, Once)
    parser.set_defaults(given={}, names={})
    return parser


def as_typed(message: str, options: argparse.Namespace) -> str:
    """A message about parameters, with the options in their place: "--seed must be ...".

    The option of `bearing_error` is --bearing-error, unless the parser's `names` has another one.
    """

    def option(match: re.Match[str]) -> str:
        name = match.group()
        if name not in options.names and not hasattr(options, name):
            return name
        typed: str = options.names.get(name, f"--{name.replace('_', '-')}")
        return f"{typed}-file" if getattr(options, f"{name}_file", None) else typed

    return PARAMETER.sub(option, message)


def _shown(value: Any) -> str:
    """A value as it was typed."""
    return " ".join(map(str, value)) if isinstance(value, list) else str(value)
