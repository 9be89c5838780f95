"""Files of the CF conventions, opened with xarray: their sizes and times."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.extras import needed

MOST_VALUES = 2**27  # of a variable, 1 GiB as float64; small files may unpack to much more
REASON = "files of the CF conventions need the package"


class TooLargeError(ValueError):
    """A variable has more values than are read."""


def check_size(path: Path, name: str, size: int) -> None:
    """Raise an error before a variable of so many values is read."""
    if size > MOST_VALUES:
        raise TooLargeError(
            f"{path} must have at most {MOST_VALUES:,} values in a variable, got {size:,} in "
            f"{name}: save a smaller area or fewer times"
        )


def opened(path: Path, **options: Any) -> Any:
    """A NetCDF file as a dataset of xarray, to read and close; times are as they are stored.

    Raises:
        ImportError: a package is missing.
        ValueError: the file is no NetCDF file.
    """
    xarray = needed("xarray", f"{REASON} xarray", "tracks")
    needed("netCDF4", f"{REASON} netCDF4", "tracks")
    given = {"decode_times": False, **options}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of several fill values, and times without calendar
            return xarray.open_dataset(path, engine="netcdf4", **given)
    except (OSError, ValueError) as error:
        raise ValueError(f"{path} must be a NetCDF file, got another: {error}") from None


def since_1970(time: Any) -> Floats:
    """A variable of times, as it is stored, in seconds since 1970; without a zone, they mean UTC.

    Raises:
        ValueError: it has no unit, or is of another calendar than the usual one.
    """
    xarray = needed("xarray", f"{REASON} xarray", "tracks")
    decoded = xarray.conventions.decode_cf_variable("time", xarray.Variable(*_parts(time)))
    return seconds_of(decoded)


def _parts(time: Any) -> tuple[Any, Any, Any]:
    return time.dims, time.values, time.attrs


def seconds_of(times: Any) -> Floats:
    """Decoded times in seconds since 1970.

    Raises:
        ValueError: they are of another calendar than the usual one.
    """
    if not np.issubdtype(times.dtype, np.datetime64):
        raise ValueError(f"times must be of the usual calendar, got {times.dtype}")
    seconds: Floats = times.values.astype("datetime64[ns]").astype(np.int64) / 1e9
    return seconds
