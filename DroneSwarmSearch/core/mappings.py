"""The mappings that `reset` and `step` return, with the look-ups of the 2023 package.

That package put "total_reward" among the drones' rewards and "Found" among their infos. RL
libraries treat every key as an agent, so here these names can be looked up, as can other facts
about the episode, but are not listed as keys. The 2023 package's `reset` returned only the
observations; here it returns a tuple that can also be indexed by drone name.
"""

from __future__ import annotations

import copy
from collections.abc import ItemsView, KeysView, Mapping, ValuesView
from typing import Any, Generic, TypeVar

from DroneSwarmSearch.core.rules import Ending, is_success

Value = TypeVar("Value")
Facts = tuple[Ending | None, tuple[int, ...], tuple[int, ...], int, float | None]
"""The ending, the missing persons, all persons, completed steps, the probability of success."""


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

    def get(self, key: str, default: Any = None, /) -> Any:
        return self[key] if key in self.NAMES else super().get(key, default)

    def __delitem__(self, key: str) -> None:
        if key not in self.NAMES:  # these are not listed anyway
            super().__delitem__(key)

    def pop(self, key: str, *default: Any) -> Any:
        return self[key] if key in self.NAMES else super().pop(key, *default)

    def copy(self) -> Any:
        return copy.copy(self)


class Rewards(_Answering[float]):
    """Each drone's reward; ``rewards["total_reward"]`` is the sum."""

    __slots__ = ()

    NAMES = frozenset({"total_reward"})

    def _answer(self, name: str) -> float:
        return sum(self.values())


class Infos(_Answering[Any]):
    """Each drone's info; facts about the whole search can be looked up, too."""

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
        return {"ending": ending, "step": step, "probability_of_success": success}[name]


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
            return super().__getitem__(0)[key]
        if isinstance(key, Mapping):  # from `for name in env.reset(): ...`
            raise TypeError("reset() returns two mappings; write observations, infos = env.reset()")
        return super().__getitem__(key)

    def __contains__(self, key: object) -> bool:
        return key in self[0] if isinstance(key, str) else super().__contains__(key)

    def keys(self) -> KeysView[str]:
        """The drones' names."""
        return self[0].keys()

    def values(self) -> ValuesView[Value]:
        """The drones' observations."""
        return self[0].values()

    def items(self) -> ItemsView[str, Value]:
        """The drones' names and observations."""
        return self[0].items()
