"""The rewards and infos of a step: dicts of the drones alone that answer one name more.

The 2023 package put "total_reward" among the drones' rewards and "Found" among their
infos. As ordinary keys these break trainers, which take every key for an agent; here
they are answered on look-up and never listed.
"""

from __future__ import annotations

from typing import Any, TypeVar, overload

__all__ = ["Infos", "Rewards"]

Value = TypeVar("Value")
Default = TypeVar("Default")


class _Answering(dict[str, Value]):
    """A dict that answers one further name, which is not among its keys."""

    __slots__ = ()

    NAME: str

    def _answer(self) -> Value:
        raise NotImplementedError

    def __missing__(self, key: str) -> Value:
        if key == self.NAME:
            return self._answer()
        raise KeyError(key)

    def __contains__(self, key: object) -> bool:
        return key == self.NAME or super().__contains__(key)

    @overload
    def get(self, key: str, default: None = None, /) -> Value | None: ...
    @overload
    def get(self, key: str, default: Value, /) -> Value: ...
    @overload
    def get(self, key: str, default: Default, /) -> Value | Default: ...
    def get(self, key: str, default: Any = None, /) -> Any:
        # A plain dict's get knows nothing of __missing__.
        return super().get(key, default) if key != self.NAME else self[key]

    def copy(self) -> Any:
        return type(self)(self)


class Rewards(_Answering[float]):
    """Each drone's reward; ``rewards["total_reward"]`` is their sum."""

    __slots__ = ()

    NAME = "total_reward"

    def _answer(self) -> float:
        return sum(self.values())


class Infos(_Answering[Any]):
    """Each drone's info; ``infos["Found"]`` tells whether any of them says "Found"."""

    __slots__ = ()

    NAME = "Found"

    def _answer(self) -> bool:
        return any(info.get("Found", False) for info in self.values())
