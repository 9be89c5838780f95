"""Values that may differ by object class, such as the width of the strip in which a drone sees."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats

ByClass = float | tuple[tuple[str, float], ...]
"""A number for all object classes, or a number for each by its key."""

BY_CLASS = ("swath", "probability_of_detection")
"""The names of such values."""


def read_by_class(name: str, value: object, read: Callable[[str, object], float]) -> ByClass:
    """A value for all classes, or one for each: a mapping, pairs, or a text, "PIW-1:100m; ...".

    Args:
        name: of the value, for messages.
        value: what was given.
        read: reads one value.
    """
    if isinstance(value, str) and ":" in value:
        texts = [part for part in value.split(";") if part.strip()]
        value = [tuple(part.strip() for part in text.partition(":")[::2]) for text in texts]
    if isinstance(value, Mapping):
        value = list(value.items())
    if not isinstance(value, (list, tuple)):
        return read(name, value)
    pairs: dict[str, float] = {}
    for pair in value:
        what = 'a value, or one for each object class, such as {"PIW-1": 100}'
        if not isinstance(pair, (list, tuple)) or len(pair) != 2 or not isinstance(pair[0], str):
            raise TypeError(f"{name} must be {what}, got {value!r:.100}")
        kind, given = pair
        if kind in pairs:
            raise ValueError(f"{name} must name each object class once, got {kind} twice")
        pairs[kind] = read(f"{name} for {kind}", given)
    if not pairs:
        raise ValueError(f"{name} must not be empty")
    return tuple(pairs.items())


def check_classes(name: str, value: ByClass, classes: Sequence[str]) -> None:
    """Raise a ValueError unless there is a value for each object class, and for no other one."""
    if isinstance(value, float):
        return
    given = [kind for kind, _ in value]
    wrong = [kind for kind in given if kind not in classes]
    missing = [kind for kind in classes if kind not in given]
    if not classes:
        raise ValueError(f"{name} cannot differ by object class, because tracks have none")
    if wrong:
        raise ValueError(f"{name} is given for {wrong[0]}, which no hypothesis has")
    if missing:
        raise ValueError(f"{name} must also be given for {missing[0]}")


def of_classes(value: ByClass, classes: Sequence[str]) -> Floats:
    """The value of each class, or of all if there are none: float64, (n,)."""
    if isinstance(value, float):
        return np.full(max(len(classes), 1), value)
    values = dict(value)
    return np.array([values[kind] for kind in classes])


def as_mapping(value: ByClass) -> float | dict[str, float]:
    """A value as files hold it."""
    return value if isinstance(value, float) else dict(value)


def in_words(value: ByClass, show: Callable[[float], str]) -> str:
    """A value in words, such as "200 m", or "100 m (PIW-1), 300 m (SKIFF-1)"."""
    if isinstance(value, float):
        return show(value)
    return ", ".join(f"{show(number)} ({kind})" for kind, number in value)
