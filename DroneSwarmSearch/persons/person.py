"""Persons to find, as plain data; `models.drift_model` computes where they may be."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import InitVar, dataclass, field
from typing import Any

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.persons.hypotheses import ROUNDING, Hypotheses
from DroneSwarmSearch.persons.known import KnownDrift
from DroneSwarmSearch.persons.markov import MarkovDrift
from DroneSwarmSearch.persons.tracks import MOST_PARTS, USUAL_PARTS, TrackDrift, Tracks


@dataclass(frozen=True)
class Person:
    """A person to find: what is known of the drift, and how well a search detects the person.

    With several hypotheses, an episode draws one of them by weight and shows it to nobody::

        Person([Drift((20, 20), weight=2), Drift((35, 12), weight=1)], probability_of_detection=0.8)

    With `Tracks`, the matrix is the weighted histogram of the tracks at every step, and the person
    is a Markov chain that only makes moves that some track made, see `drift.chain`::

        Person(Tracks.read("drift.nc", ...), probability_of_detection=0.8)

    With a `MarkovDrift`, the person moves by transition probabilities of your own.

    Args:
        drift: one `Drift`, a sequence of them, `Tracks`, or a `MarkovDrift`.
        probability_of_detection: see below.
        survival: see below.
        fine: with tracks, where a person goes next depends on one of fine² parts of the cell; from
            1 to 4. With 1, plans promise more than they find; 3 and 4 need many tracks.
        classes: with tracks, the number of groups of similar tracks, at most that of the tracks; a
            person belongs to one of them for good. Time and memory grow with it.

    Attributes:
        drift: what is known of the drift: `Hypotheses`, `TrackDrift` or another `KnownDrift`.
        probability_of_detection: of a search of the person's cell, from 0 to 1.
        survival: the probability of being alive, value t after t completed steps, and the last
            value from then on; never increasing. Any array or sequence; a tuple is kept. Plans,
            policies, `RewardScheme.expected` and `Evaluation.success_alive` weigh finds by it; it
            does not change who is found. None: always alive.

    Raises:
        TypeError: a value is of the wrong type.
        ValueError: a value is out of its limits.
    """

    drift: Any
    probability_of_detection: float = 1.0
    survival: Sequence[float] | Floats | None = field(default=None, kw_only=True, repr=False)
    fine: InitVar[int] = field(default=USUAL_PARTS, kw_only=True)
    classes: InitVar[int] = field(default=1, kw_only=True)

    def __post_init__(self, fine: int, classes: int) -> None:
        detection = checks.real("probability_of_detection", self.probability_of_detection, 0, 1)
        fine = checks.integer("fine", fine, 1, MOST_PARTS)
        classes = checks.integer("classes", classes, 1)
        known = self.drift
        if isinstance(known, Tracks):
            known = TrackDrift(known, fine, classes)
        elif (fine, classes) != (USUAL_PARTS, 1):
            raise ValueError(
                f"fine and classes belong to tracks, got fine={fine} and classes={classes} with "
                f"{type(known).__name__}"
            )
        if not isinstance(known, KnownDrift):
            known = Hypotheses(known)
        object.__setattr__(self, "drift", known)
        object.__setattr__(self, "probability_of_detection", detection)
        if self.survival is not None:
            object.__setattr__(self, "survival", _survival(self.survival))

    def alive(self, step: int) -> float:
        """The probability of being alive after a number of completed steps, from `survival`."""
        return 1.0 if self.survival is None else self.survival[min(step, len(self.survival) - 1)]

    def to_dict(self) -> dict[str, Any]:
        """Return the values as plain data for JSON; `from_dict` reads it.

        Of tracks it holds the name and the SHA-256 of their file, see `Tracks.to_dict`.
        """
        data = self.drift.to_dict() | {"probability_of_detection": self.probability_of_detection}
        return data if self.survival is None else {**data, "survival": list(self.survival)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Person:
        """Make a person from the output of `to_dict`, see `Drift.from_dict`."""
        own = ("probability_of_detection", "survival")
        if "markov" in data:
            values = checks.known_keys("a person", data, ("markov", *own))
            return cls(MarkovDrift.from_dict(values.pop("markov")), **values)
        if "tracks" in data:
            values = checks.known_keys("a person", data, ("tracks", *own, "fine", "classes"))
            return cls(Tracks.from_dict(values.pop("tracks")), **values)
        values = checks.known_keys("a person", data, ("drifts", *own))
        return cls(Hypotheses.from_list(values.pop("drifts", None)), **values)


def warn_of_mass_beyond(
    persons: Sequence[Person], grid_size: int, timestep_limit: int, stacklevel: int
) -> None:
    """Warn if more than 1% of a person's forecast lies beyond the grid within the time limit."""
    last = checks.integer("timestep_limit", timestep_limit, 1, checks.LARGEST_EXACT)
    steps = {round(last * part / 32) for part in range(33)}  # a forecast comes and goes smoothly
    # Tracks warn when a model is made of them.
    drifting = [person.drift for person in persons if not isinstance(person.drift, TrackDrift)]
    every = [(drift.mass_beyond(grid_size, step), -step) for drift in drifting for step in steps]
    beyond, step = max(every, default=(0.0, 0))
    if beyond > 0.01:
        warnings.warn(
            f"{beyond:.1%} of a person's forecast lies beyond the grid of {grid_size} x "
            f"{grid_size} cells at step {-step}: take a larger grid, or larger cells",
            stacklevel=stacklevel + 1,
        )


def _survival(value: object) -> tuple[float, ...]:
    what = "one or more probabilities from 0 to 1, none above the one before"
    given = checks.numbers("survival", value, what).astype(np.float64)
    if given.ndim != 1 or not given.size:
        raise ValueError(f"survival must be {what}, got an array of shape {given.shape}")
    wrong = ~((given >= 0.0) & (given <= 1.0))
    wrong[1:] |= np.diff(given) > ROUNDING
    if wrong.any():
        raise ValueError(f"survival must be {what}, got {given[wrong][0]} at step {wrong.argmax()}")
    return tuple(given.tolist())
