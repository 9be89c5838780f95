"""The mappings that `reset` and `step` return, with the look-ups of the 2023 package.

That package put "total_reward" among the drones' rewards and "Found" among their infos. RL
libraries treat every key as an agent, so here these names can be looked up but are not listed as
keys. Other facts about the episode can be looked up in the same way. The 2023 package's `reset`
returned only the observations; here it returns (observations, infos), a tuple that can also be
indexed by drone name.
"""

from __future__ import annotations

from collections.abc import ItemsView, Iterable, KeysView, Mapping, ValuesView
from typing import Any, Generic, TypeVar, overload

from DroneSwarmSearch.rules import Ending, is_success

__all__ = ["Infos", "Rewards", "Start", "SuccessInfos"]

Value = TypeVar("Value")
Default = TypeVar("Default")
Facts = tuple[Ending | None, tuple[int, ...], tuple[int, ...], int, float | None]
"""The ending or None, the missing persons, all persons, completed steps, and the probability of
success or None."""


class _Answering(dict[str, Value]):
    """A dict with additional names that can be looked up but are not listed as keys."""

    __slots__ = ()

    NAMES: frozenset[str]

    def _answer(self, name: str) -> Value:
        raise NotImplementedError

    def __missing__(self, key: str) -> Value:
        if key in self.NAMES:
            return self._answer(key)
        raise KeyError(key)

    def __contains__(self, key: object) -> bool:
        return super().__contains__(key) or key in self.NAMES

    @overload
    def get(self, key: str, default: None = None, /) -> Value | None: ...
    @overload
    def get(self, key: str, default: Value, /) -> Value: ...
    @overload
    def get(self, key: str, default: Default, /) -> Value | Default: ...
    def get(self, key: str, default: Any = None, /) -> Any:
        # dict.get ignores __missing__.
        return self[key] if key in self.NAMES else super().get(key, default)

    def __setitem__(self, key: str, value: Value) -> None:
        self._refuse((key,))
        super().__setitem__(key, value)

    def setdefault(self, key: str, default: Any = None, /) -> Any:
        return self[key] if key in self.NAMES else super().setdefault(key, default)

    def update(self, *values: Any, **more: Any) -> None:
        new: dict[str, Value] = dict(*values, **more)
        self._refuse(new)
        super().update(new)

    def __ior__(self, other: Any) -> Any:  # type: ignore[misc]
        self.update(other)
        return self

    def _refuse(self, keys: Iterable[object]) -> None:
        for key in keys:
            if key in self.NAMES:
                raise ValueError(f"{key!r} is computed on look-up and cannot be set")

    def __delitem__(self, key: str) -> None:
        if key not in self.NAMES:  # these are not listed anyway
            super().__delitem__(key)

    def pop(self, key: str, *default: Any) -> Any:
        return self[key] if key in self.NAMES else super().pop(key, *default)

    def copy(self) -> Any:
        return type(self)(self)


class Rewards(_Answering[float]):
    """Each drone's reward; ``rewards["total_reward"]`` is the sum."""

    __slots__ = ()

    NAMES = frozenset({"total_reward"})

    def _answer(self, name: str) -> float:
        return sum(self.values())


class Infos(_Answering[Any]):
    """Each drone's info; facts about the whole search can be looked up, too.

    Attributes:
        facts: all but "Found" are computed from these.
    """

    __slots__ = ("facts",)

    NAMES = frozenset({"Found", "is_success", "persons_found", "ending", "step"})

    facts: Facts

    def _answer(self, name: str) -> Any:
        if name == "Found":
            return any(info.get("Found", False) for info in self.values())
        ending, missing, persons, step, success = self.facts
        if name == "is_success":
            return is_success(ending)
        if name == "persons_found":
            return tuple(person not in missing for person in persons)
        if name == "probability_of_success":
            return success
        return ending if name == "ending" else step

    def copy(self) -> Infos:
        """A shallow copy with the same look-ups."""
        copied = type(self)(self)
        copied.facts = self.facts
        return copied


class SuccessInfos(Infos):
    """`Infos` that answer "probability_of_success", too: environments with beliefs return them."""

    __slots__ = ()

    NAMES = Infos.NAMES | {"probability_of_success"}


class Start(tuple[dict[str, Value], Infos], Generic[Value]):
    """What `reset` returns: the tuple (observations, infos).

    It can also be used like the observations alone: ``env.reset()["drone0"]`` is a drone's
    observation, and `keys`, `values` and `items` work.
    """

    __slots__ = ()

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str):
            return self._observations[key]
        if isinstance(key, Mapping):  # from `for name in env.reset(): ...`
            raise TypeError("reset() returns two mappings; write observations, infos = env.reset()")
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
