"""Signatures of constructors that pass keywords on to another class."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import TypeVar

__all__ = ["with_keywords_of"]

Constructor = TypeVar("Constructor", bound=Callable[..., None])


def with_keywords_of(source: type, *without: str) -> Callable[[Constructor], Constructor]:
    """Decorate a constructor that passes **keywords on: show their names in its signature.

    Args:
        source: the class whose constructor receives the keywords.
        without: keywords that are not shown.
    """

    def decorate(init: Constructor) -> Constructor:
        own = inspect.signature(init)
        shown = [each for each in own.parameters.values() if each.kind is not each.VAR_KEYWORD]
        names = {each.name for each in shown}.union(without)
        for each in inspect.signature(source).parameters.values():
            if each.kind is each.KEYWORD_ONLY and each.name not in names:
                shown.append(each)
        init.__signature__ = own.replace(parameters=shown)  # type: ignore[attr-defined]
        return init

    return decorate
