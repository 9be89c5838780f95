"""Tracks: where a drift simulation sends many copies of a person, from arrays or files."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Hashable, Mapping
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints
from DroneSwarmSearch._internal.files import replacing
from DroneSwarmSearch.drift.chain import Chain, class_labels, fine_cells
from DroneSwarmSearch.drift.scale import Scale

if TYPE_CHECKING:
    from DroneSwarmSearch.scenario import Scenario

__all__ = ["Tracks"]

_MOST_LOST = 0.1
"""The largest share of lost tracks: what becomes of them is unknown, so that more would mislead."""

MOST_UNSEEN = 0.1
"""The share of held-out tracks where no other is, above which there is a warning."""

_SAMPLED_STEPS = 8


class Tracks:
    """The tracks of many copies of a person, as a drift simulation makes them.

    A `Person` made of tracks drifts as they do, whatever moved them: currents, tides, a wind that
    veers, a coast::

        tracks = Tracks.read("drift.nc", scale=scale, origin=(4.8, 60.1), cell=(30, 30))
        fitted, held_out = tracks.split()
        scenario = Scenario(61, persons=Person(fitted, probability_of_detection=0.8))

    Args:
        positions: where each track is at steps 0 to T, in cells: shape (T + 1, P, 2), x first. A
            position is in the cell to which it rounds. A track that ends in NaN stays where it was
            last, as if stranded. The array is not copied: do not change it.
        weights: how likely each track is relative to the others, shape (P,); by default, equally.

    Attributes:
        positions: without NaN; float64, read-only.
        weights: float64, shape (P,), above 0; they sum to 1. Tracks of weight 0 are left out.
        stranded: the number of tracks that end in NaN, or are stranded in a file.
        lost: the number of tracks in a file that end for another reason, and are left out.
        source: the file, its SHA-256 and the arguments of `read`, as plain data; or None.

    Raises:
        TypeError: an argument holds no real numbers.
        ValueError: an argument has a wrong shape, a track jumps more than a cell along an axis in a
            step or has NaN before its end, or the weights are not finite, or below 0, or all 0.
    """

    def __init__(self, positions: ArrayLike, weights: ArrayLike | None = None) -> None:
        what = "real numbers of shape (steps + 1, tracks, 2), in cells, x first"
        given = checks.numbers("positions", positions, what).astype(np.float64, copy=False)
        if given.ndim != 3 or given.shape[2] != 2 or min(given.shape) < 1 or len(given) < 2:
            raise ValueError(f"positions must be {what}, got shape {given.shape}")
        self.lost = 0
        self.source: dict[str, Any] | None = None
        given, self.stranded = _without_gaps(given)
        shares = np.full(given.shape[1], 1.0)
        if weights is not None:
            shares = checks.numbers("weights", weights, "a real number for each track")
            shares = shares.astype(np.float64, copy=False)
            if shares.shape != given.shape[1:2]:
                raise ValueError(
                    f"weights must be {given.shape[1]} numbers, one for each track, "
                    f"got shape {shares.shape}"
                )
            if not (np.isfinite(shares).all() and shares.min() >= 0.0 < shares.max()):
                raise ValueError("weights must be finite, at least 0 and not all 0")
            if not shares.all():
                given, shares = given[:, shares > 0.0], shares[shares > 0.0]
        _check_jumps(given)
        self.positions: Floats = given.view()
        self.weights: Floats = shares / shares.sum()
        self.positions.flags.writeable = self.weights.flags.writeable = False
        self._chains: dict[object, Chain] = {}
        self._labels: dict[object, Ints] = {}

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_chains": {}, "_labels": {}}

    def __deepcopy__(self, memo: object) -> Tracks:
        return self

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Tracks):
            return NotImplemented
        return self is other or (
            np.array_equal(self.positions, other.positions)
            and np.array_equal(self.weights, other.weights)
        )

    def __hash__(self) -> int:
        return hash((self.positions.shape, self.positions[-1].tobytes()))

    def __len__(self) -> int:
        return len(self.weights)

    def __repr__(self) -> str:
        counts = f"{len(self):,} tracks, {self.steps} steps"
        counts += f", {self.stranded:,} stranded" * (self.stranded > 0)
        counts += f", {self.lost:,} lost and left out" * (self.lost > 0)
        low, high = self.positions.min(axis=(0, 1)), self.positions.max(axis=(0, 1))
        ranges = (f"{name} {a:.1f} to {b:.1f}" for name, a, b in zip("xy", low, high, strict=True))
        return f"<Tracks: {counts}, {', '.join(ranges)}>"

    @property
    def steps(self) -> int:
        """The number of steps, T."""
        return len(self.positions) - 1

    @property
    def vector(self) -> tuple[float, float]:
        """The mean drift in cells per step, (x, y)."""
        x, y = (self.weights @ (self.positions[-1] - self.positions[0]) / self.steps).tolist()
        return x, y

    # Parts of the tracks.

    def split(self, held_out: float = 0.25, seed: int = 0) -> tuple[Tracks, Tracks]:
        """Split the tracks at random: those to fit a person to, and those to test a plan on.

        Args:
            held_out: the share of the second part, above 0 and below 1.
            seed: of the random order, which never follows that of the tracks.
        """
        share = checks.real("held_out", held_out, 0, 1)
        count = round(share * len(self))
        if not 0 < count < len(self):
            raise ValueError(
                f"held_out must leave at least one track on either side, got {held_out!r} "
                f"of {len(self)} tracks"
            )
        order = np.random.default_rng(checks.integer("seed", seed, 0)).permutation(len(self))
        return self._of(order[count:]), self._of(order[:count])

    def thin(self, n: int, seed: int = 0) -> Tracks:
        """Keep n of the tracks, drawn at random without replacement."""
        count = checks.integer("n", n, 1, len(self))
        return self._of(np.random.default_rng(seed).permutation(len(self))[:count])

    def _of(self, which: Ints) -> Tracks:
        which = np.sort(which)
        return Tracks(self.positions[:, which], self.weights[which])

    # The drift model.

    def chain(self, grid_size: int, fine: int = 2, classes: int | ArrayLike = 1) -> Chain:
        """The drift model of the tracks on a grid; see `Person` for the arguments."""
        size, labels = checks.integer("grid_size", grid_size, 2), self.labels(classes)
        key = size, fine, id(labels)
        if key not in self._chains:
            off = max(self.mass_beyond(size, step) for step in _some_steps(self.steps))
            if off > 0.01:
                warnings.warn(
                    f"{off:.1%} of the tracks are off the grid of {size} x {size} cells at a step, "
                    "and count as in its outer cells: take a larger grid, or larger cells",
                    stacklevel=2,
                )
            self._chains[key] = Chain(self, size, fine, labels)
        return self._chains[key]

    def labels(self, classes: int | ArrayLike) -> Ints:
        """The class of each track, int64, (P,), from a number of classes or given labels."""
        if not isinstance(classes, Hashable):
            classes = tuple(np.asarray(classes).tolist())
        if classes not in self._labels:
            if isinstance(classes, tuple):
                what = f"an integer, or an integer from 0 for each of {len(self)} tracks"
                given = checks.integer_array("classes", classes, what, 0, 2**31, (len(self),))
                labels = np.unique(given, return_inverse=True)[1].astype(np.int64)
            else:
                labels = class_labels(self, checks.integer("classes", classes, 1, len(self)))
            self._labels[classes] = labels
        return self._labels[classes]

    def mass_beyond(self, grid_size: int, step: int) -> float:
        """The share of the tracks that are off the grid at a step."""
        cells = np.floor(self.positions[min(step, self.steps)] + 0.5)
        return float(self.weights @ ((cells < 0) | (cells >= grid_size)).any(axis=1))

    def check_number(self, fine: int) -> None:
        """Warn if the tracks are too few for parts of cells of this size."""
        if (unseen := self.unseen(fine)) > MOST_UNSEEN:
            warnings.warn(
                f"{len(self):,} tracks are few: of those held out, {unseen:.0%} are where no other "
                "track is, and a plan promises more than it finds; take more tracks"
                + ", or fine=1"
                * (fine > 1),
                stacklevel=4,
            )

    def unseen(self, fine: int) -> float:
        """The share of a quarter of the tracks in fine cells where the others never are.

        It is a mean over some steps, and near 0 if the tracks are many enough.
        """
        shares, held_out = [], np.zeros(len(self), np.bool_)
        held_out[np.random.default_rng(0).permutation(len(self))[: len(self) // 4]] = True
        for step in _some_steps(self.steps):
            x, y = np.floor((self.positions[step].T + 0.5) * fine)
            places = x * 2.0**26 + y
            new = ~np.isin(places[held_out], places[~held_out])
            shares.append(self.weights[held_out] @ new)
        return float(np.mean(shares) / max(self.weights[held_out].sum(), self.weights.min()))

    # Plans.

    def found(
        self, policy: Any, scenario: Scenario | None = None, *, drones_positions: object = None
    ) -> float:
        """The share of these tracks that a plan or a policy finds by the time limit.

        Nobody is found on the way: the drones search on as if without success, and each search of
        a track's cell finds it with the probability of detection. Compare the result, for tracks
        that were held out from the fit, with the probability of success that the search promises.

        Args:
            policy: a policy, which maps the observations of the environment to actions; or a plan,
                the actions of all drones: integers of shape (steps, n_drones).
            scenario: the search, for one person; by default the policy's `scenario`.
            drones_positions: the drones' start cells, as for `reset`.
        """
        from DroneSwarmSearch.evaluation.rollout import searches_of

        search: Any = scenario or getattr(policy, "scenario", None)
        missed, size = self.weights.copy(), search.grid_size
        for step, cells in enumerate(searches_of(policy, search, drones_positions)):
            x, y = fine_cells(self.positions[min(step, self.steps)], size, 1)
            missed[np.isin(y * size + x, cells)] *= 1.0 - search.detections[0]
        return 1.0 - float(missed.sum())

    # Files.

    def save(self, path: str | Path, fine: int = 2) -> None:
        """Write the tracks to a compact file, ``.npz``, that `read` reads.

        Positions are rounded to the middle of `fine` by `fine` parts of each cell, so that a
        `Person` with the same `fine` stays the same.
        """
        parts = np.floor((self.positions + 0.5) * checks.integer("fine", fine, 1, 127))
        steps = np.diff(parts, axis=0).astype(np.int8)
        with replacing(_npz(path)) as spare:
            np.savez_compressed(
                spare, start=parts[0].astype(np.int32), steps=steps, fine=fine, weights=self.weights
            )

    @classmethod
    def read(
        cls,
        path: str | Path,
        *,
        scale: Scale | None = None,
        origin: tuple[float, float] | None = None,
        cell: tuple[float, float] = (0.0, 0.0),
        start: datetime | None = None,
        steps: int | None = None,
        diffusivity: float = 0.0,
        seed: int = 0,
    ) -> Tracks:
        """Read tracks from a NetCDF file of OpenDrift, another CF trajectory file, or `save`.

        Reading NetCDF needs the extra ``tracks``. A file has the variables of longitude, latitude
        and time, by their standard names, for each trajectory at common times. Stranded elements
        (by OpenDrift's `status`) stay where they are. Elements that are not yet released at
        `start`, or vanish for another reason before the last step, are lost and left out.

        Args:
            path: a file that ends in ``.npz`` is one of `save`, and takes no other arguments.
            scale: the size of cells and the duration of steps.
            origin: the position (longitude, latitude) in degrees that lies in the middle of `cell`.
            cell: a cell (x, y) of the grid; north is up.
            start: when the search begins, with its time zone; by default the file's first time.
            steps: the number of steps; by default as many as the file covers.
            diffusivity: of the turbulent sea in m²/s, if the simulation had none: a random walk of
                variance 2 K t along each axis is added until an element strands. OpenDrift's Leeway
                model has none by default.
            seed: of this random walk.

        Raises:
            ImportError: netCDF4 is missing.
            OSError: there is no such file.
            TypeError: an argument is of the wrong type.
            ValueError: the file or an argument is unsuitable, or more than a tenth of the elements
                are lost.
        """
        file = Path(path)
        arguments: dict[str, Any] = {}
        if file.suffix == ".npz":
            result = _unpacked(file)
        else:
            from DroneSwarmSearch.drift import track_files

            if not isinstance(scale, Scale):
                raise TypeError(f"scale must be a Scale, got {scale!r}")
            arguments = {
                "origin": checks.pair("origin", origin),
                "cell": checks.pair("cell", cell),
                "start": _utc(start),
                "steps": None if steps is None else checks.integer("steps", steps, 1),
                "diffusivity": checks.real("diffusivity", diffusivity, 0),
                "seed": checks.integer("seed", seed, 0),
            }
            positions, lost = track_files.positions(file, scale, **arguments)
            if lost > _MOST_LOST * (lost + positions.shape[1]):
                raise ValueError(
                    f"{file} must hold at most {_MOST_LOST:.0%} of elements that end before the "
                    f"last step without being stranded, got {lost:,} of "
                    f"{lost + positions.shape[1]:,}: simulate a larger area, or take fewer steps"
                )
            result = cls(positions)
            result.lost = lost
            arguments = {**arguments, "scale": [scale.metres_per_cell, scale.seconds_per_step]}
        digest = hashlib.sha256(file.read_bytes()).hexdigest()
        result.source = {"file": str(path), "sha256": digest, **arguments}
        return result

    def to_dict(self) -> dict[str, Any]:
        """The file of the tracks and its SHA-256 as plain data for JSON, which `from_dict` reads.

        Tracks from arrays have no file, and cannot be restored.
        """
        if self.source is not None:
            start = self.source.get("start")
            return {**self.source, **({"start": start.isoformat()} if start else {})}
        digest = hashlib.sha256(self.positions.tobytes() + self.weights.tobytes()).hexdigest()
        return {"file": None, "sha256": digest}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Tracks:
        """Read the file of `to_dict` again.

        Raises:
            ValueError: the tracks were given as arrays, or the file has changed.
        """
        arguments = {**data}
        file, digest = arguments.pop("file"), arguments.pop("sha256")
        if file is None:
            raise ValueError(
                "tracks must come from a file to be restored, got tracks that were given as "
                "arrays: write them with Tracks.save, and use those of Tracks.read"
            )
        if arguments.get("scale"):
            arguments["scale"] = Scale(*arguments["scale"])
        if arguments.get("start"):
            arguments["start"] = datetime.fromisoformat(arguments["start"])
        tracks = cls.read(file, **arguments)
        assert tracks.source is not None
        if tracks.source["sha256"] != digest:
            raise ValueError(f"tracks must be those of {file} when it was saved; it has changed")
        return tracks


def _without_gaps(positions: Floats) -> tuple[Floats, int]:
    """Positions where tracks that end in NaN stay where they were, and the number of these."""
    with np.errstate(over="ignore", invalid="ignore"):
        if np.isfinite(positions.sum()):
            return positions, 0
    if np.isinf(positions).any():
        raise ValueError("positions must be finite, or NaN at the end of a track, got inf")
    missing: Flags = np.any(np.isnan(positions), axis=2)
    wrong: Flags = missing[0] | (missing[:-1] & ~missing[1:]).any(axis=0)
    if wrong.any():
        raise ValueError(
            "positions may be NaN only from some step to the end of a track, where it stays; "
            f"got {np.count_nonzero(wrong):,} with NaN at the start or in the middle, "
            f"the first of them track {int(wrong.argmax())}"
        )
    filled = positions.copy()
    for step in range(1, len(filled)):
        filled[step, missing[step]] = filled[step - 1, missing[step]]
    return filled, int(missing[-1].sum())


def _check_jumps(positions: Floats) -> None:
    """Raise a ValueError if a track goes farther than to an adjacent cell in a step."""
    before = np.floor(positions[0] + 0.5)
    for step, now in enumerate(positions[1:], 1):
        cells = np.floor(now + 0.5)
        farthest = np.abs(cells - before).max(axis=1)
        if farthest.max() > 1:
            raise ValueError(
                f"positions must move at most one cell along each axis in a step, but track "
                f"{int(farthest.argmax())} moves {farthest.max():.0f} in step {step}, as do "
                f"{np.count_nonzero(farthest > 1) - 1:,} others: take shorter steps or larger cells"
            )
        before = cells


def _some_steps(last: int) -> list[int]:
    """Some steps from 0 to the last one."""
    return sorted({round(last * part / _SAMPLED_STEPS) for part in range(_SAMPLED_STEPS + 1)})


def _utc(start: object) -> datetime | None:
    if start is None:
        return None
    if not isinstance(start, datetime):
        raise TypeError(f"start must be a datetime with a time zone, got {start!r}")
    if start.tzinfo is None:
        raise ValueError(f"start must have a time zone, such as tzinfo=timezone.utc, got {start!r}")
    return start.astimezone(timezone.utc)


def _npz(path: str | Path) -> Path:
    if Path(path).suffix != ".npz":
        raise ValueError(f"path must end in .npz, got {str(path)!r}")
    return Path(path)


def _unpacked(file: Path) -> Tracks:
    try:
        with np.load(file) as data:
            start, steps, fine, weights = (data[k] for k in ("start", "steps", "fine", "weights"))
    except (KeyError, ValueError) as error:
        raise ValueError(f"{file} must be a file of Tracks.save, got another: {error}") from None
    parts: NDArray[np.int64] = np.empty((len(steps) + 1, *start.shape), np.int64)
    parts[0] = start
    np.cumsum(steps, axis=0, out=parts[1:])
    parts[1:] += start
    return Tracks((parts + 0.5) / int(fine) - 0.5, weights)
