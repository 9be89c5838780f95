"""Fields of current and wind, from the files of ocean and weather models."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints, Singles
from DroneSwarmSearch.geo.flows import Clock, Flow, Origin
from DroneSwarmSearch.geo.forecast_files import read_forecast
from DroneSwarmSearch.geo.model_grid import PlaneTable, plane_table

MOST_OUTSIDE = 0.01  # the largest share of points off the field; they get the values at its edge


@dataclass(frozen=True, eq=False)
class Field(Flow):
    """A velocity at times and points.

    It is linear in space. In time it is a cubic through the values of the file, whose slope at each
    is that from the value before to the one after (E. Catmull, R. Rom, A class of local
    interpolating splines, 1974): hourly values lose some thousandths of a tide.

    Attributes:
        path: the file.
        model: its title, or else its name.
        times: in seconds since 1970, increasing: float64, (T,).
        ends: the first and the last time of the file, in seconds since 1970.
        table: where points lie on the grid.
        values: along the grid's rows and columns, or to the east and to the north, in m/s, and 1;
            all 0 where nothing is ever known, on land: float32, (members, T, Y * X, 3).
    """

    path: Path
    model: str
    times: Floats
    ends: tuple[float, float]
    table: PlaneTable
    values: Singles

    @classmethod
    def read(cls, path: Path, kind: str, origin: Origin) -> Field:
        """Read the part of a file around the origin; `kind` is "current" or "wind".

        Raises:
            ImportError: a package that reads the file is missing.
            ValueError: the file has no such field, one that is not understood, or none at the
                origin.
        """
        forecast = read_forecast(path, kind, origin.position, origin.time)
        table = plane_table(forecast.latitudes, forecast.longitudes, origin.plane)
        if not forecast.along_grid:
            table = replace(table, directions=None)
        values = _filled(forecast.values)
        field = cls(
            kind,
            origin,
            path=path,
            model=forecast.title,
            times=forecast.times,
            ends=(forecast.first, forecast.last),
            table=table,
            values=values.reshape(*values.shape[:2], -1, 3),
        )
        if table.is_beyond(np.zeros((2, 1))).any():
            raise ValueError(
                f"{kind} must cover the position, {origin.position}, but {path} does not"
            )
        if np.isnan(field.velocity(0.0, np.zeros((2, 1)))).any():
            raise ValueError(
                f"position must be at sea, but {path} has no {kind} at {origin.position}"
            )
        return field

    def _key(self) -> tuple[object, ...]:
        return self.kind, self.origin, self.source

    @property
    def source(self) -> str:
        return os.path.realpath(self.path)

    @property
    def varies(self) -> bool:
        return True

    @property
    def members(self) -> int:
        return len(self.values)

    @property
    def hours(self) -> str:
        """The first and the last time."""
        first, last = (datetime.fromtimestamp(time, timezone.utc) for time in self.ends)
        return f"{first:%Y-%m-%d %H:%M} to {last:%Y-%m-%d %H:%M} UTC"

    def moved(self, origin: Origin) -> Field:
        if origin == self.origin:
            return self
        return Field.read(self.path, self.kind, origin)

    def as_typed(self, folder: str) -> str:
        return os.path.relpath(self.path, folder)

    def described(self, clock: Clock) -> str:
        members = f", {self.members} members" if self.members > 1 else ""
        return f"{self.kind} of {self.model}, {self.hours}{members}"

    def check_times(self, until: datetime) -> None:
        begin = self.origin.time.timestamp()
        if not self.ends[0] <= begin or not until.timestamp() <= self.ends[1]:
            raise ValueError(
                f"{self.kind} must cover the drift, from {self.origin.time:%Y-%m-%d %H:%M} to "
                f"{until:%Y-%m-%d %H:%M} UTC, but {self.path} covers only {self.hours}"
            )

    def check_within(self, times: float | Floats, points: Floats) -> None:
        if np.mean(self.table.is_beyond(points)) > MOST_OUTSIDE:
            raise ValueError(
                f"{self.kind} must cover the drift, but {self.path} covers only a part of the area"
            )

    def _towards(self, times: float | Floats, points: Floats, members: Ints | None) -> Floats:
        """The velocity to the east and to the north; off the field, that at its edge."""
        rows, columns = self.table.shape
        at_row, at_column = self.table.cells_at(points)
        row = np.clip(at_row, 0, rows - 1)
        column = np.clip(at_column, 0, columns - 1)
        before_row = np.minimum(row.astype(np.int64), rows - 2)
        before_column = np.minimum(column.astype(np.int64), columns - 2)
        up = row - before_row
        right = column - before_column
        corner = np.array([0, 1, columns, columns + 1])[:, None]
        in_space = np.stack(
            [(1 - up) * (1 - right), (1 - up) * right, up * (1 - right), up * right]
        )

        values, begin, in_time = self._at_times(times, members)
        index = begin[:, None] + (before_row * columns + before_column + corner)  # (k, 4, n)
        shares = (in_time[:, None] * in_space).astype(np.float32)
        total = (shares[..., None] * values.take(index, axis=0)).sum(axis=(0, 1))
        along_row, along_column, known = np.asarray(total, np.float64).T
        with np.errstate(invalid="ignore", divide="ignore"):
            velocity = np.where(known >= 0.5, [along_row, along_column] / known, np.nan)
        return self.table.turned(velocity, points)

    def _at_times(
        self, times: float | Floats, members: Ints | None
    ) -> tuple[Singles, Ints, Floats]:
        """Values by cell, (..., 3); the index of the first cell of a time, and the time's share.

        Both are (k, n) or (k, 1).
        """
        at = np.asarray(self.origin.time.timestamp() + times)
        indices, shares = _cubic(at, self.times)
        cells = self.values.shape[2]
        fields = self._mean if members is None else self.values
        of_member = np.zeros(1, np.int64) if members is None else members * cells
        if at.ndim == 0:  # for many points, it pays to interpolate all fields in time first
            now = np.zeros_like(fields[:, 0])
            for index, share in zip(indices.tolist(), shares.astype(np.float32), strict=True):
                now += share * fields[:, index]
            return now.reshape(-1, 3), of_member[None], np.ones((1, 1))
        begin = of_member * len(self.times) + indices * cells
        return fields.reshape(-1, 3), begin, shares

    @cached_property
    def _mean(self) -> Singles:
        """The mean of all members: (1, T, Y * X, 3)."""
        mean: Singles = self.values.mean(axis=0, keepdims=True, dtype=np.float32)
        return mean


def _filled(values: Singles) -> Singles:
    """The components and 1, (members, T, Y, X, 3); 0 on land, where values are never known.

    A cell that is dry at some times keeps the last value that is known, or the next one.
    """
    known: Flags = np.all(np.isfinite(values), axis=0)
    at_sea = known.any(axis=(0, 1))
    whole = np.where(known, values, 0.0).astype(np.float32)
    gaps = at_sea & ~known
    if gaps.any():
        steps = np.arange(known.shape[1])[:, None, None]
        last = np.maximum.accumulate(np.where(known, steps, -1), axis=1)
        after = np.where(known, steps, known.shape[1])[:, ::-1]
        following = np.minimum.accumulate(after, axis=1)[:, ::-1]
        taken = np.clip(np.where(last >= 0, last, following), 0, known.shape[1] - 1)
        whole = np.take_along_axis(whole, np.broadcast_to(taken, whole.shape), axis=2)
    ones = np.broadcast_to(at_sea, known.shape)
    filled: Singles = np.stack([*whole, ones], axis=-1).astype(np.float32)
    return filled


def _cubic(times: Any, axis: Floats) -> tuple[Ints, Any]:
    """The four times around each time, (4, ...), and their shares in a Catmull-Rom spline.

    At the ends, the slope is that to the next time.
    """
    last = len(axis) - 1
    clipped = np.clip(times, axis[0], axis[-1])
    here = np.clip(axis.searchsorted(clipped, side="right") - 1, 0, last - 1)
    indices = np.stack([np.maximum(here - 1, 0), here, here + 1, np.minimum(here + 2, last)])
    before, begin, end, after = axis[indices]
    length = end - begin
    s = (clipped - begin) / length
    at_begin = 2 * s**3 - 3 * s**2 + 1
    at_end = 1 - at_begin
    slope_at_begin = (s**3 - 2 * s**2 + s) * length / (end - before)
    slope_at_end = (s**3 - s**2) * length / (after - begin)
    shares = np.stack(
        [
            -slope_at_begin,
            at_begin - slope_at_end,
            at_end + slope_at_begin,
            slope_at_end,
        ]
    )
    return indices, shares
