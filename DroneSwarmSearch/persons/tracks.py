"""Tracks: where a drift simulation sends many copies of a person, from arrays or files."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Mapping
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Flags, Floats
from DroneSwarmSearch._internal.files import replacing
from DroneSwarmSearch.geo.scale import Scale
from DroneSwarmSearch.persons import track_files
from DroneSwarmSearch.persons.known import KnownDrift

FARTHEST = 200
"""Cells from the given cell; if no track comes nearer, the position is probably a mistake."""

USUAL_PARTS = 2  # of a cell along each side, on which a person's next move depends
MOST_PARTS = 4

MOST_UNSEEN = 0.1
"""The share of held-out tracks where no other track is, above which there is a warning."""


class Tracks:
    """The tracks of many copies of a person, as a drift simulation makes them.

    A `Person` made of tracks drifts as they do, whatever moved them: currents, tides, a wind that
    veers, a coast::

        tracks = Tracks.read("drift.nc", scale=scale, origin=(60.1, 4.8), cell=(30, 30))
        fitted, held_out = tracks.split()
        scenario = Scenario(61, persons=Person(fitted, probability_of_detection=0.8))

    Args:
        positions: where each track is at steps 0 to T, in cells: shape (T + 1, P, 2), x first. The
            cell is the rounded position. A track that ends in NaN stays where it was last, as if
            stranded. The array is not copied: do not change it.
        weights: how likely each track is relative to the others, shape (P,); by default, equally.

    Attributes:
        positions: without NaN; float64, read-only.
        weights: float64, shape (P,), above 0; they sum to 1. Tracks of weight 0 are left out.
        stranded: the number of tracks that end in NaN, or strand in a file.
        lost: the number of tracks in a file that end for another reason, and are left out.
        source: the file, its SHA-256 and the arguments of `read`, as plain data; or None.
        chains: the drift models made of them so far.

    Raises:
        TypeError: an argument holds no real numbers.
        ValueError: an argument has a wrong shape, a track jumps more than a cell along an axis in a
            step or has NaN before its end, or the weights are not finite, or below 0, or all 0.
    """

    def __init__(self, positions: ArrayLike, weights: ArrayLike | None = None) -> None:
        what = "real numbers of shape (steps + 1, tracks, 2), in cells, x first"
        given = checks.numbers("positions", positions, what).astype(np.float64, copy=False)
        if given.ndim != 3 or given.shape[2] != 2 or given.shape[1] < 1 or len(given) < 2:
            raise ValueError(f"positions must be {what}, got shape {given.shape}")
        shares = np.ones(given.shape[1])
        if weights is not None:
            what = f"{len(shares)} finite numbers of at least 0, one for each track, not all 0"
            shares = checks.numbers("weights", weights, what).astype(np.float64)
            is_valid = shares.shape == given.shape[1:2] and np.isfinite(shares).all()
            if not (is_valid and shares.min() >= 0.0 < shares.max()):
                raise ValueError(f"weights must be {what}, got {weights!r:.100}")
            shares = shares / shares.max()
            positive = shares > 1e-300  # others may become 0
            if not positive.all():
                given = given[:, positive]
                shares = shares[positive]
        given, self.stranded = _without_gaps(given)
        _check_jumps(given)
        self.positions: Floats = given.view()
        self.weights: Floats = shares / shares.sum()
        self.positions.flags.writeable = self.weights.flags.writeable = False
        self.lost = 0
        self.source: dict[str, Any] | None = None
        self.chains: dict[tuple[int, ...], Any] = {}

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "chains": {}}

    def __deepcopy__(self, memo: object) -> Tracks:
        return self

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Tracks):
            return NotImplemented
        pairs = (self.positions, other.positions), (self.weights, other.weights)
        return self is other or all(np.array_equal(*pair) for pair in pairs)

    def __hash__(self) -> int:
        return hash((self.positions.shape, (self.positions[-1] + 0.0).tobytes()))

    def __len__(self) -> int:
        return len(self.weights)

    def __repr__(self) -> str:
        text = f"{len(self):,} tracks, {self.steps} steps"
        if self.stranded:
            text += f", {self.stranded:,} stranded"
        if self.lost:
            text += f", {self.lost:,} lost and left out"
        low = self.positions.min(axis=(0, 1))
        high = self.positions.max(axis=(0, 1))
        if self.source and self.source.get("start"):
            text += f", from {self.source['start']}"
        ranges = zip("xy", low, high, strict=True)
        text += "".join(f", {name} {first:.1f} to {last:.1f}" for name, first, last in ranges)
        return f"<Tracks: {text}>"

    @property
    def steps(self) -> int:
        """The number of steps, T."""
        return len(self.positions) - 1

    @cached_property
    def vector(self) -> tuple[float, float]:
        """The mean drift in cells per step, (x, y)."""
        x, y = (self.weights @ (self.positions[-1] - self.positions[0]) / self.steps).tolist()
        return x, y

    # Parts of the tracks.

    def split(self, held_out: float = 0.25, seed: int = 0) -> tuple[Tracks, Tracks]:
        """Split the tracks at random: to fit a person, and the share held out to test plans on."""
        count = round(checks.real("held_out", held_out, 0, 1) * len(self))
        if not 0 < count < len(self):
            raise ValueError(
                f"held_out must leave tracks in both parts, got {held_out!r} of {self}"
            )
        order = np.random.default_rng(checks.integer("seed", seed, 0)).permutation(len(self))
        parts = order[count:], order[:count]
        fitted, held = (Tracks(self.positions[:, part], self.weights[part]) for part in parts)
        return fitted, held

    def thin(self, n: int, seed: int = 0) -> Tracks:
        """Keep n of the tracks, drawn at random without replacement."""
        count = checks.integer("n", n, 1, len(self))
        seed = checks.integer("seed", seed, 0)
        chosen = np.random.default_rng(seed).permutation(len(self))[:count]
        return Tracks(self.positions[:, chosen], self.weights[chosen])

    def mass_beyond(self, grid_size: int, step: int) -> float:
        """The share of the tracks that are off the grid at a step."""
        cells = np.floor(self.positions[min(step, self.steps)] + 0.5)
        return float(self.weights @ ((cells < 0) | (cells >= grid_size)).any(axis=1))

    @property
    def some_steps(self) -> list[int]:
        """A few steps from the first to the last."""
        return sorted({round(self.steps * part / 8) for part in range(9)})

    # Files.

    def save(self, path: str | Path, fine: int = USUAL_PARTS) -> None:
        """Write a compact ``.npz`` for `read`: with this `fine` and one class, the same person."""
        if Path(path).suffix != ".npz":
            raise ValueError(f"path must end in .npz, got {str(path)!r}")
        fine = checks.integer("fine", fine, 1, MOST_PARTS)
        parts = np.floor((self.positions + 0.5) * fine)
        arrays = {
            "start": parts[0].astype(np.int32),
            "steps": np.diff(parts, axis=0).astype(np.int8),
        }
        with replacing(Path(path)) as spare:
            np.savez_compressed(spare, fine=np.array(fine), weights=self.weights, **arrays)

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

        NetCDF needs the extra ``tracks``: variables with the standard names longitude, latitude and
        time, or lon, lat and time by name, with common times for all elements. Stranded elements
        (by OpenDrift's `status`) stay where they are. Elements that are not yet released at
        `start`, or vanish for another reason before the last step, are lost and left out.

        Args:
            path: a file that ends in ``.npz`` is one of `save`, and takes no other arguments.
            scale: the size of cells and the duration of steps.
            origin: the position (latitude, longitude) in degrees of the middle of `cell`.
            cell: a cell (x, y) of the grid; north is up.
            start: when the search begins, with its time zone; by default the file's first time at
                which all elements are adrift.
            steps: the number of steps; by default as many as the file covers.
            diffusivity: of the turbulent sea in m²/s, if the simulation had none, as OpenDrift's
                Leeway model by default: a random walk of variance 2 K t along each axis is added
                until an element strands.
            seed: of this random walk.

        Raises:
            ImportError: netCDF4 is missing.
            OSError: there is no such file.
            TypeError, ValueError: the file or an argument is unsuitable, or more than a tenth of
                the elements are lost.
        """
        file = Path(path)
        if not file.is_file():
            raise FileNotFoundError(f"path must name a file, but there is no {str(path)!r}")
        source: dict[str, Any] = {"file": str(path), "sha256": _digest(file)}
        if file.suffix == ".npz":
            given = (scale, origin, cell, start, steps, diffusivity, seed)
            if given != (None, None, (0.0, 0.0), None, None, 0.0, 0):
                raise ValueError(
                    "scale, origin, cell, start, steps, diffusivity and seed belong to NetCDF, "
                    f"but {path} is a file of Tracks.save, whose tracks are in cells"
                )
            tracks = _unpacked(file)
            tracks.source = source
            return tracks
        if not isinstance(scale, Scale):
            raise TypeError(f"scale must be a Scale, got {scale!r}")
        arguments: dict[str, Any] = {
            "origin": checks.pair("origin", origin, "(latitude, longitude) in degrees"),
            "cell": checks.pair("cell", cell),
            "start": _checked_start(start),
            "steps": None if steps is None else checks.integer("steps", steps, 1),
            "diffusivity": checks.real("diffusivity", diffusivity, 0),
            "seed": checks.integer("seed", seed, 0),
        }
        positions, stranded, lost, released = track_files.positions(file, scale, **arguments)
        _warn_if_far(path, positions, arguments["origin"], arguments["cell"])
        if released and start is None:
            arguments["start"] = released.isoformat()
        try:
            tracks = cls(positions)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
        tracks.stranded = stranded
        tracks.lost = lost
        size = [scale.metres_per_cell, scale.seconds_per_step]
        tracks.source = {**source, **arguments, "scale": size}
        return tracks

    def to_dict(self) -> dict[str, Any]:
        """The `source` as plain data for JSON, from which `from_dict` reads the file again.

        Tracks from arrays have no file, only a hash, and cannot be restored.
        """
        if self.source is not None:
            return {**self.source}
        digest = hashlib.sha256(self.positions.tobytes() + self.weights.tobytes()).hexdigest()
        return {"file": None, "sha256": digest}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Tracks:
        """Read the file of `to_dict` again.

        Raises:
            ValueError: the tracks were given as arrays, or the file has changed.
        """
        arguments = {**data}
        file = arguments.pop("file")
        digest = arguments.pop("sha256")
        if file is None:
            raise ValueError(
                "tracks must come from a file to be restored, but these were given as arrays: "
                "write such tracks with Tracks.save, and use what Tracks.read returns"
            )
        if arguments:
            start = arguments["start"] and datetime.fromisoformat(arguments["start"])
            arguments.update(scale=Scale(*arguments["scale"]), start=start)
        tracks = cls.read(file, **arguments)
        if tracks.to_dict()["sha256"] != digest:
            raise ValueError(f"{file} must be as it was when its SHA-256 was saved; it has changed")
        return tracks


def _digest(path: Path) -> str:
    """The SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _checked_start(start: object) -> str | None:
    """A time as text; TypeError or ValueError unless it is a datetime with a zone, or None."""
    if start is None:
        return None
    if not isinstance(start, datetime):
        raise TypeError(f"start must be a datetime with a time zone, got {start!r}")
    if start.tzinfo is None:
        raise ValueError(f"start must be a datetime with a time zone, got {start!r}")
    return start.isoformat()


def _warn_if_far(path: str | Path, positions: Floats, origin: Any, cell: Any) -> None:
    """Warn if no track comes near the given cell: its position is probably a mistake."""
    nearest = np.abs(positions - cell).max(axis=2).min()
    if nearest > FARTHEST:
        warnings.warn(
            f"no track of {path} comes within {nearest:.0f} cells of cell={cell}, the "
            f"position origin={origin}: are latitude and longitude exchanged, here or in "
            "the file?",
            stacklevel=3,
        )


class TrackDrift(KnownDrift):
    """Tracks, and how exactly a person follows them; see `Person` for the arguments."""

    def __init__(self, tracks: Tracks, fine: int = USUAL_PARTS, classes: int = 1) -> None:
        self.tracks = tracks
        self.fine = checks.integer("fine", fine, 1, MOST_PARTS)
        self.classes = checks.integer("classes", classes, 1, len(tracks))
        self.key = tracks, self.fine, self.classes
        self.vector = tracks.vector
        self.outline = f" from {len(tracks):,} tracks"
        self._check_number(tracks, self.fine)

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), self.key

    def __eq__(self, other: object) -> bool:
        return self.key == other.key if isinstance(other, TrackDrift) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.key)

    def __repr__(self) -> str:
        return f"TrackDrift({self.tracks!r}, fine={self.fine}, classes={self.classes})"

    def check(self, grid_size: int, timestep_limit: int, name: str) -> None:
        if self.tracks.steps < timestep_limit:
            raise ValueError(
                f"timestep_limit must be at most {self.tracks.steps}, the steps of the tracks of "
                f"{name}, got {timestep_limit}"
            )

    def mass_beyond(self, grid_size: int, step: int) -> float:
        return self.tracks.mass_beyond(grid_size, step)

    def to_dict(self) -> dict[str, Any]:
        return {"tracks": self.tracks.to_dict(), "fine": self.fine, "classes": self.classes}

    @staticmethod
    def _check_number(tracks: Tracks, fine: int) -> None:
        """Warn if the tracks are too few for cells of `fine` by `fine` parts."""
        shares = []
        held_out = np.zeros(len(tracks), np.bool_)
        held_out[np.random.default_rng(0).permutation(len(tracks))[: -(-len(tracks) // 4)]] = True
        for step in tracks.some_steps:
            x, y = np.floor((tracks.positions[step].T + 0.5) * fine)
            parts = x * 2.0**26 + y
            shares.append(1.0 - np.isin(parts[held_out], parts[~held_out]).mean())
        if (unseen := np.mean(shares)) > MOST_UNSEEN:
            warnings.warn(
                f"{len(tracks):,} tracks are few: of a quarter held out, {unseen:.0%} are where no "
                "other track is, so a plan promises more than it finds; take more tracks",
                stacklevel=5,
            )


def _without_gaps(positions: Floats) -> tuple[Floats, int]:
    """Positions where tracks that end in NaN stay where they were, and the number of these."""
    with np.errstate(over="ignore", invalid="ignore"):
        if np.isfinite(positions.sum()):
            return positions, 0
    missing: Flags = np.any(~np.isfinite(positions), axis=2)
    wrong: Flags = missing[0] | np.any(missing[:-1] & ~missing[1:], axis=0)
    wrong |= np.any(np.isinf(positions), axis=(0, 2))
    if wrong.any():
        raise ValueError(
            "positions must be finite, or NaN from some step to the end of a track, got inf, or "
            f"NaN at the start or in the middle, in {np.count_nonzero(wrong):,} tracks, the first "
            f"of them track {int(wrong.argmax())}"
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
        moves = np.abs(cells - before)
        if moves.max() > 1:
            farthest = moves.max(axis=1)
            raise ValueError(
                "positions must move at most one cell along each axis in a step, but track "
                f"{int(farthest.argmax())} moves {farthest.max():.0f} in step {step}, as do "
                f"{np.count_nonzero(farthest > 1) - 1:,} others: take shorter steps or larger cells"
            )
        before = cells


def _unpacked(file: Path) -> Tracks:
    """The tracks in a file of `Tracks.save`."""
    try:
        with file.open("rb") as opened, np.load(opened) as data:
            start, steps, fine, weights = (data[k] for k in ("start", "steps", "fine", "weights"))
    except Exception:  # one of many types, as the file may be anything
        raise ValueError(f"{file} must be a file of Tracks.save, got another") from None
    parts = np.concatenate([start[None], steps]).cumsum(axis=0, dtype=np.int64)
    return Tracks((parts + 0.5) / int(fine) - 0.5, weights)
