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
        shown = [each for each in own if each.kind is not each.VAR_KEYWORD]
        names = {each.name for each in shown}.union(without)
        for each in inspect.signature(source).parameters.values():
            by_name = each.kind in (each.KEYWORD_ONLY, each.POSITIONAL_OR_KEYWORD)
            if by_name and each.name not in names:
                shown.append(each.replace(kind=each.KEYWORD_ONLY))
        plain = [each.replace(annotation=each.empty) for each in shown]
        made.__signature__ = inspect.Signature(plain)  # type: ignore[attr-defined]
        return made

    return decorate
