"""Options that may be given once, and errors that name them as they are typed."""

from __future__ import annotations

import argparse
import re
from typing import Any

BEGINNING = re.compile(r"\w+(?=[ \[:,])")
"""The parameter that a message is about, if it is about one."""

OTHER = re.compile(r"(?:(?<=together with )|(?<=needs )|(?<=before ))\w+(?=[ ,;]|$)")
"""Where such a message may name another one."""


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
    Messages that begin otherwise, such as with the path of a file, stay as they are.
    """

    def option(match: re.Match[str]) -> str:
        name = match.group()
        if name not in options.names and not hasattr(options, name):
            return name
        typed: str = options.names.get(name, f"--{name.replace('_', '-')}")
        return f"{typed}-file" if getattr(options, f"{name}_file", None) else typed

    beginning = BEGINNING.match(message)
    if beginning is None or option(beginning) == beginning.group():
        return message
    return option(beginning) + OTHER.sub(option, message[beginning.end() :])


def _shown(value: Any) -> str:
    """A value as it was typed."""
    return " ".join(map(str, value)) if isinstance(value, list) else str(value)
