"""Signatures of constructors that pass keywords on."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import TypeVar

Class = TypeVar("Class", bound=type)


def shows_keywords_of(source: type, *without: str) -> Callable[[Class], Class]:
    """List in the decorated class's signature the **keywords that its constructor passes on.

    The signature shows names and defaults of all but the parameters named, without types.
    """

    def decorate(made: Class) -> Class:
        _, *own = inspect.signature(made.__init__).parameters.values()  # type: ignore[misc]
        listed = [parameter for parameter in own if parameter.kind is not parameter.VAR_KEYWORD]
        names = {parameter.name for parameter in listed}.union(without)
        for parameter in inspect.signature(source).parameters.values():
            by_name = parameter.kind in (parameter.KEYWORD_ONLY, parameter.POSITIONAL_OR_KEYWORD)
            if by_name and parameter.name not in names:
                listed.append(parameter.replace(kind=parameter.KEYWORD_ONLY))
        plain = [parameter.replace(annotation=parameter.empty) for parameter in listed]
        made.__signature__ = inspect.Signature(plain)  # type: ignore[attr-defined]
        return made

    return decorate
