"""Hypotheses about a drift, as plain data; `axes` computes where the person may be."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch._internal.erf import erf
from DroneSwarmSearch.persons.known import KnownDrift

MAX_DIFFUSION = 2 / 3  # the variance of a step to one of three adjacent cells at random
_LARGE = 1e300  # stands for larger numbers, so that differences of two of them stay finite

ROUNDING = 1e-12

Vector = tuple[float, float] | Floats | Mapping[int, tuple[float, float]]


@dataclass(frozen=True, eq=False, repr=False)
class Drift:
    """One hypothesis about a person: the start, the drift, and how uncertain both are.

    After tau = adrift + t steps, the person's position along each axis has the mean
    start + vector * tau and the variance start_sd² + diffusion * tau + (vector_sd * tau)²; the
    drift is constant during an episode, but known only up to `vector_sd`. Persons move at most
    one cell per step along each axis, even if the vector is longer::

        Drift((20, 20), start_sd=3, vector=(0.2, -0.1), vector_sd=0.05, diffusion=0.1)

    A drift that varies in time, such as a tide, has a vector for each step. Their sum over the
    first tau steps takes the place of vector * tau. Steps count from the start of the drift, so
    the first ones are those adrift::

        Drift((20, 20), start_sd=3, vector={0: (0.3, 0), 100: (-0.3, 0)}, diffusion=0.1, adrift=50)

    Two drifts are equal if their values are, whichever form the values were given in.

    Attributes:
        start: where the person is when the drift begins. A cell (x, y) of the grid; real
            numbers, also outside the grid, along an axis where `start_sd` is positive, or
            along both if `adrift` is; or an array of shape (grid_size, grid_size), indexed
            [y, x]: the probability of each cell up to a factor. A read-only float64 copy
            that sums to 1 is kept. With an array, the spread by `vector_sd` can be coarse,
            because it is computed along one axis at a time: prefer several drifts with `start_sd`.
        start_sd: standard deviation of the start, in cells: a number, or a pair (x, y). Kept as
            a pair; 0 for an array.
        vector: mean drift in cells per step, (x, y); y grows downward. Or one for each step, of
            shape (steps, 2), and the last one from then on; or a mapping of steps to vectors,
            linear in between, and constant before the first and after the last one. A series is
            kept as a read-only float64 array with a row for each step until the last change.
        vector_sd: standard deviation of the drift, in cells per step: a number or a pair (x, y).
            Or one for each step, like `vector`, of any sign: the magnitude of their sum over
            the first tau steps takes the place of vector_sd * tau, and may shrink again.
        diffusion: growth of the position's variance along each axis, in cells² per step, twice
            the diffusion coefficient; from 0 to 2/3.
        adrift: whole steps of drift before the search begins; 0 for an array.
        weight: how likely the hypothesis is relative to the person's other ones; above 0.

    Raises:
        TypeError: a value is of the wrong type.
        ValueError: a value is out of its limits.
    """

    start: tuple[float, float] | Floats
    start_sd: float | tuple[float, float] = field(default=0.0, kw_only=True)
    vector: Vector = field(default=(0.0, 0.0), kw_only=True)
    vector_sd: float | Vector = field(default=0.0, kw_only=True)
    diffusion: float = field(default=0.0, kw_only=True)
    adrift: int = field(default=0, kw_only=True)
    weight: float = field(default=1.0, kw_only=True)

    def __post_init__(self) -> None:
        start_sd = _deviations("start_sd", self.start_sd)
        adrift = checks.integer("adrift", self.adrift, 0, checks.LARGEST_EXACT)
        start = _start(self.start, start_sd, adrift)
        for name, given in (("start_sd", start_sd), ("adrift", adrift)):
            if isinstance(start, np.ndarray) and np.any(given):
                raise ValueError(f"{name} must be 0 if start is an array, got {given!r}")
        vector_sd = _vector("vector_sd", self.vector_sd, _deviations)
        if isinstance(vector_sd, tuple):
            # The sum of equal deviations has their magnitude, whatever their sign.
            x, y = vector_sd
            vector_sd = (abs(x), abs(y))
        values = {
            "start": start,
            "start_sd": start_sd,
            "vector": _vector("vector", self.vector, checks.pair),
            "vector_sd": vector_sd,
            "diffusion": checks.real("diffusion", self.diffusion, 0, MAX_DIFFUSION + ROUNDING),
            "adrift": adrift,
            "weight": checks.positive("weight", self.weight),
        }
        object.__setattr__(self, "_key_points", self._given_key_points())
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def _given_key_points(self) -> dict[str, dict[int, Any]]:
        """The series that were given as mappings of steps, in plain form."""
        given = {}
        for name in ("vector", "vector_sd"):
            value = getattr(self, name)
            if isinstance(value, Mapping):
                points = {int(step): list(checks.pair(name, value[step])) for step in sorted(value)}
                given[name] = points
        return given

    def __reduce__(self) -> tuple[object, ...]:
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return partial(type(self), **(values | self.key_points)), ()

    @property
    def key_points(self) -> dict[str, dict[int, Any]]:
        """The vectors by step of those parameters that were given as mappings."""
        given: dict[str, dict[int, Any]] = self._key_points  # type: ignore[attr-defined]
        return {name: dict(points) for name, points in given.items()}

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Drift):
            return NotImplemented
        return self.key == other.key and self.weight == other.weight

    def __hash__(self) -> int:
        return hash((self.key, self.weight))

    def __repr__(self) -> str:
        values = [getattr(self, field.name) for field in fields(self)]
        start, *others = (
            f"<array of shape {value.shape}>" if isinstance(value, np.ndarray) else repr(value)
            for value in values
        )
        named = [
            f"{field.name}={text}" for field, text in zip(fields(self)[1:], others, strict=True)
        ]
        return f"Drift({start}, {', '.join(named)})"

    @property
    def prior(self) -> Floats | None:
        """The start if it is an array, shape (grid_size, grid_size), indexed [y, x]; or None."""
        return self.start if isinstance(self.start, np.ndarray) else None

    def vector_in(self, step: int) -> tuple[float, float]:
        """The mean drift in a step of the search, (x, y)."""
        rows = np.atleast_2d(np.asarray(self.vector))
        x, y = rows[min(self.adrift + step, len(rows) - 1)].tolist()
        return x, y

    def spread(self, step: int) -> Floats:
        """The mean (x, y) and the standard deviations (x, y) at a step: float64, (2, 2).

        On a grid without borders. If the start is an array, they describe the displacement from it.
        """
        tau = np.array(self.adrift + step, np.float64)
        start = self.start if self.prior is None else 0.0
        with np.errstate(over="ignore"):
            mean = np.add(start, displaced(np.asarray(self.vector), tau))
            by_drift = displaced(np.asarray(self.vector_sd), tau)
            deviation = np.hypot(np.hypot(self.start_sd, np.sqrt(self.diffusion * tau)), by_drift)
        return np.array([mean, deviation])

    def mass_beyond(self, grid_size: int, step: int) -> float:
        """The probability that the person would be beyond the grid if nothing stopped there.

        The matrix never leaves the grid: its mean stops at the border, and it is truncated. This
        is the share of the untruncated Gaussian outside of the grid after some completed steps.

        Raises:
            TypeError: an argument is not an integer.
            ValueError: an argument is out of its limits, or the start does not fit.
        """
        size = checks.integer("grid_size", grid_size, 2, checks.LARGEST_EXACT)
        spread = self.spread(checks.integer("step", step, 0, checks.LARGEST_EXACT))
        self.check_grid(size)
        starts = np.zeros(1) if self.prior is None else np.arange(size)
        x, y = (_within(size, starts + mean, deviation) for mean, deviation in spread.T.tolist())
        inside = float(x[0] * y[0] if self.prior is None else y @ self.prior @ x)
        return min(max(1.0 - inside, 0.0), 1.0)

    @cached_property
    def key(self) -> tuple[object, ...]:
        """A hashable key of everything but the weight; equal for equal forecasts."""
        values = (getattr(self, field.name) for field in fields(self) if field.name != "weight")
        return tuple(v.tobytes() if isinstance(v, np.ndarray) else v for v in values)

    def check_grid(self, grid_size: int, name: str = "drift") -> None:
        """Raise a ValueError, with this drift's name, if the start does not fit on a grid."""
        name = f"{name}.start"
        shape = (grid_size, grid_size)
        if isinstance(self.start, np.ndarray):
            if self.start.shape != shape:
                raise ValueError(
                    f"{name} must be a cell (x, y) or an array of shape {shape}, "
                    f"got one of shape {self.start.shape}"
                )
            return
        deviations: Any = self.start_sd
        for index, deviation in enumerate(deviations):
            if _known(deviation, self.adrift) and not self.start[index] <= grid_size - 1:
                raise ValueError(
                    f"{name}[{index}] must be a whole number from 0 to {grid_size - 1} "
                    f"unless start_sd or adrift is positive, got start={self.start}"
                )

    def to_dict(self) -> dict[str, Any]:
        """Return the values as plain data for JSON; `from_dict` reads it."""
        return {
            field.name: np.asarray(getattr(self, field.name)).tolist() for field in fields(self)
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Drift:
        """Make a drift from the output of `to_dict`; missing values get their defaults.

        A series may be a mapping of steps, also as texts, to vectors.

        Raises:
            TypeError: `data` is not a mapping of parameters, or one is of the wrong type.
            ValueError: a value is out of its limits.
        """
        values = checks.known_keys("a drift", data, [field.name for field in fields(cls)])
        for name in ("vector", "vector_sd"):
            points = values.get(name)
            if isinstance(points, Mapping):  # JSON has steps as texts
                values[name] = {_step(name, step): points[step] for step in points}
        return cls(**values)


class Hypotheses(KnownDrift):
    """One or more hypotheses about a drift, one of which is true.

    Args:
        drifts: one `Drift` or a sequence of them; a tuple is kept.
    """

    def __init__(self, drifts: object) -> None:
        what = "a Drift, a sequence of them or Tracks"
        given: Any = [drifts] if isinstance(drifts, Drift) else checks.items("drifts", drifts, what)
        if not given:
            raise ValueError(f"drifts must hold at least one Drift, got {drifts!r}")
        for index, drift in enumerate(given):
            if not isinstance(drift, Drift):
                raise TypeError(f"drifts[{index}] must be a Drift, got {drift!r}")
        self.drifts: tuple[Drift, ...] = tuple(given)
        largest = max(drift.weight for drift in self.drifts)
        relative = [drift.weight / largest for drift in self.drifts]
        total = math.fsum(relative)
        self.weights = tuple(weight / total for weight in relative)
        self.key = (*(drift.key for drift in self.drifts), self.weights)

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.drifts,)

    def __eq__(self, other: object) -> bool:
        return self.drifts == other.drifts if isinstance(other, Hypotheses) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.drifts)

    def __repr__(self) -> str:
        return repr(self.drifts)

    @property
    def vector(self) -> tuple[float, float]:  # type: ignore[override]
        """The mean drift in the search's first step, in cells per step, (x, y)."""
        pairs = list(zip(self.weights, self.drifts, strict=True))
        x, y = (
            sum(weight * drift.vector_in(0)[axis] for weight, drift in pairs) for axis in (0, 1)
        )
        return x, y

    @property
    def outline(self) -> str:  # type: ignore[override]
        if len(self.drifts) == 1:
            return ""
        return f" with up to {len(self.drifts)} hypotheses"

    def check(self, grid_size: int, timestep_limit: int, name: str) -> None:
        for index, drift in enumerate(self.drifts):
            drift.check_grid(grid_size, f"{name}.drifts[{index}]")

    def mass_beyond(self, grid_size: int, step: int) -> float:
        """The mean of `Drift.mass_beyond` over the drifts, by weight."""
        beyond = [drift.mass_beyond(grid_size, step) for drift in self.drifts]
        return math.fsum(w * mass for w, mass in zip(self.weights, beyond, strict=True))

    def to_dict(self) -> dict[str, Any]:
        return {"drifts": [drift.to_dict() for drift in self.drifts]}

    @classmethod
    def from_list(cls, data: Any) -> Hypotheses:
        """Make hypotheses from a list of the outputs of `Drift.to_dict`."""
        drifts: list[Drift] = []
        given: list[Any] = checks.items("drifts", data, "a list of drifts")
        for index, values in enumerate(given):
            try:
                drifts.append(Drift.from_dict(values))
            except (TypeError, ValueError) as error:
                raise type(error)(f"drifts[{index}]: {error}") from None
        return cls(drifts)


def displaced(rates: Floats, tau: Any) -> Floats:
    """The displacement after tau steps, (..., A), at rates (A,), or at rates of each step, (T, A).

    Each axis keeps its last rate when its rates end; NaN pads the shorter axis.
    """
    displacement: Floats
    if rates.ndim == 1:
        displacement = rates * tau
    else:
        known, index = rate_at(rates, tau)
        sums = np.insert(np.cumsum(rates[:-1], axis=0), 0, 0.0, axis=0)
        displacement = sums[index] + rates[index] * (tau - known)
    return displacement


def rate_at(rates: Floats, tau: Any) -> tuple[Floats, tuple[Ints, Ints]]:
    """The steps before tau with rates of their own, all but the last; and the index of the next."""
    known = np.minimum(np.floor(tau), np.isfinite(rates).sum(axis=0) - 1)
    return known, (known.astype(np.int64), np.arange(rates.shape[1]))


def _start(
    value: object, start_sd: tuple[float, float], adrift: int
) -> tuple[float, float] | Floats:
    what = "a cell (x, y) or an array of shape (grid_size, grid_size)"
    given = checks.numbers("start", value, what)
    if given.ndim == 2:
        return _probabilities(given)
    if given.shape != (2,):
        error = TypeError if given.ndim == 0 else ValueError
        raise error(f"start must be {what}, got {value!r}")
    cell = checks.pair("start", given.tolist())
    known = [_known(deviation, adrift) for deviation in start_sd]
    for index, coordinate in enumerate(cell):
        if known[index] and not (coordinate >= 0 and coordinate.is_integer()):
            raise ValueError(
                f"start[{index}] must be a whole number of at least 0 unless start_sd or adrift "
                f"is positive, got start={value!r}"
            )
    return (int(cell[0]), int(cell[1])) if all(known) else cell


def _known(start_sd: float, adrift: int) -> bool:
    """Whether the cell at step 0 is known along an axis."""
    return start_sd == 0.0 and adrift == 0


def _probabilities(given: NDArray[Any]) -> Floats:
    """A read-only float64 copy that sums to 1."""
    rows, columns = given.shape
    if rows != columns or rows < 2:
        raise ValueError(
            f"start must be an array of shape (grid_size, grid_size), got {rows, columns}"
        )
    values = given.astype(np.float64)
    if not values.min() >= 0.0:
        raise ValueError(f"start must be an array of numbers of at least 0, got {values.min()}")
    with np.errstate(over="ignore"):
        total = values.sum()
    if not 0.0 < total < np.inf:
        raise ValueError(f"start must have a positive, finite sum, got {total}")
    if abs(total - 1.0) > ROUNDING:  # so that a copy has the same values
        values /= total
    values += 0.0  # turns -0.0 into 0.0
    return _read_only(values)


def _read_only(values: Floats) -> Floats:
    """A copy that cannot be made writeable, because it is on top of bytes."""
    return np.frombuffer(values.tobytes()).reshape(values.shape)


def _step(name: str, text: object) -> object:
    """The step that a text of digits means; anything else is left to the checks."""
    return int(text) if isinstance(text, str) and text.isdecimal() else text


def _vector(name: str, value: Any, of_one: Callable[..., tuple[float, float]]) -> Vector:
    """A pair for all steps, or a read-only array with a row for each one until the last change."""
    what = "one vector, or vectors (x, y) of finite numbers for each step"
    if isinstance(value, Mapping):
        steps = sorted(checks.integer(f"a step of {name}", s, 0, 10**7) for s in value)
        given = np.array([checks.pair(f"{name}[{step}]", value[step]) for step in steps])
        every = np.arange(max(steps, default=0) + 1)
        value = np.array([np.interp(every, steps, column) for column in given.T]).T
    elif checks.is_number(value) or all(map(checks.is_number, checks.items(name, value, what))):
        return of_one(name, value)
    rows = np.array(checks.numbers(name, value, what), np.float64) + 0.0  # no -0.0
    if rows.ndim != 2 or rows.shape[1] != 2 or not np.isfinite(rows).all():
        raise ValueError(f"{name} must be {what}, got {value!r:.100}")
    changes = np.flatnonzero((rows[1:] != rows[:-1]).any(axis=1))
    if changes.size:
        return _read_only(rows[: changes[-1] + 2])
    x, y = rows[0].tolist()
    return x, y


def _within(grid_size: int, means: Floats, deviation: float) -> Floats:
    """The probability of being within the grid along an axis, for each of some means."""
    means = np.clip(means, -_LARGE, _LARGE)
    deviation = min(deviation, _LARGE)
    low = -0.5 - means
    high = grid_size - 0.5 - means
    if deviation == 0.0:
        inside: Floats = ((low <= 0.0) & (high > 0.0)).astype(np.float64)
        return inside
    return 0.5 * (erf(high / (deviation * math.sqrt(2))) - erf(low / (deviation * math.sqrt(2))))


def _deviations(name: str, value: object) -> tuple[float, float]:
    """A standard deviation along each axis, from one number or a pair."""
    what = "a number of at least 0 or a pair (x, y) of them"
    both = [value, value] if checks.is_number(value) else checks.items(name, value, what)
    if len(both) != 2:
        raise ValueError(f"{name} must be {what}, got {value!r}")
    x, y = (checks.real(name, number, 0) for number in both)
    return x, y
