"""What `reset` and `step` return where scripts for the 2023 package look for something else.

That package put "total_reward" among the drones' rewards and "Found" among their infos. As
ordinary keys these break trainers, which take every key for an agent; here they are answered
on look-up and never listed. And its `reset` returned the observations alone, where PettingZoo
now has two things; here the two are a tuple that answers drones' names as well.
"""

from __future__ import annotations

from collections.abc import ItemsView, Iterable, KeysView, Mapping, ValuesView
from typing import Any, Generic, TypeVar, overload

__all__ = ["Infos", "Rewards", "Start"]

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

    def __setitem__(self, key: str, value: Value) -> None:
        self._refuse((key,))
        super().__setitem__(key, value)

    def setdefault(self, key: str, default: Any = None, /) -> Any:
        return super().setdefault(key, default) if key != self.NAME else self._answer()

    def update(self, *values: Any, **more: Any) -> None:
        new: dict[str, Value] = dict(*values, **more)
        self._refuse(new)
        super().update(new)

    def __ior__(self, other: Any) -> Any:  # type: ignore[misc]
        self.update(other)
        return self

    def _refuse(self, keys: Iterable[object]) -> None:
        if self.NAME in keys:
            raise ValueError(f"{self.NAME!r} follows from the drones' values and cannot be set")

    def __delitem__(self, key: str) -> None:
        if key != self.NAME:  # which is not listed anyway
            super().__delitem__(key)

    def pop(self, key: str, *default: Any) -> Any:
        return super().pop(key, *default) if key != self.NAME else self._answer()

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


class Start(tuple[dict[str, Value], Infos], Generic[Value]):
    """What `reset` returns: (observations, infos), a tuple like any other.

    A drone's name leads to its observation, ``env.reset()["drone0"]``, and so do `keys`,
    `values` and `items`, as when the observations were all that `reset` returned.
    """

    __slots__ = ()

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str):
            return self._observations[key]
        if isinstance(key, Mapping):  # from going through it as if it were the observations
            raise TypeError(
                "reset() returns two things; write observations, infos = env.reset(), got a "
                "look-up of one of them in both"
            )
        return super().__getitem__(key)

    def __contains__(self, key: object) -> bool:
        return key in self._observations if isinstance(key, str) else super().__contains__(key)

    @property
    def _observations(self) -> dict[str, Value]:
        observations, _ = self
        return observations

    def keys(self) -> KeysView[str]:
        """The drones' names."""
        return self._observations.keys()

    def values(self) -> ValuesView[Value]:
        """The drones' observations."""
        return self._observations.values()

    def items(self) -> ItemsView[str, Value]:
        """The drones' names and observations."""
        return self._observations.items()
