"""NetCDF files of the CF conventions: opening them, and their sizes and times."""

from __future__ import annotations

from datetime import timezone
from pathlib import Path
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.extras import needed

MOST_VALUES = 2**27  # of a variable, 1 GiB as float64; small files may unpack to much more


class TooLargeError(ValueError):
    """A variable has more values than are read."""


def check_size(path: Path, name: str, size: int) -> None:
    """Raise an error before a variable of so many values is read."""
    if size > MOST_VALUES:
        raise TooLargeError(
            f"{path} must have at most {MOST_VALUES:,} values in a variable, got {size:,} in "
            f"{name}: save a smaller area or fewer times"
        )


def opened(path: Path) -> Any:
    """A NetCDF file, to read and close."""
    netcdf = needed("netCDF4", "reading NetCDF needs the package netCDF4", "tracks")
    try:
        return netcdf.Dataset(path)
    except OSError as error:
        raise ValueError(f"{path} must be a NetCDF file, got another: {error}") from None


def since_1970(values: Any, time: Any) -> Floats:
    """Values of the variable `time` in seconds since 1970; CF times have no zone, so mean UTC."""
    import netCDF4

    calendar = getattr(time, "calendar", "standard")
    dates: Any = netCDF4.num2date(
        values,
        time.units,
        calendar,
        only_use_cftime_datetimes=False,
        only_use_python_datetimes=True,
    )
    return np.array([date.replace(tzinfo=timezone.utc).timestamp() for date in np.ma.filled(dates)])
