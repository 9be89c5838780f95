"""Files of tracks as drift simulations write them: shared by tests."""

from datetime import datetime, timezone

import numpy as np
import pytest

nc = pytest.importorskip("netCDF4")


NOON = datetime(2026, 6, 1, 12, tzinfo=timezone.utc)


HOURS = 3600.0 * np.arange(4)


FLAGS = {"flag_values": np.array([0, 1, 2], np.int32), "flag_meanings": "active stranded outside"}


def write(
    path,
    tracks,
    seconds=HOURS,
    *,
    status=None,
    flags=FLAGS,
    names=("lon", "lat", "time"),
    standard_names=True,
    order=("trajectory", "time"),
    dtype="f4",
    **attributes,
):
    """Write positions in degrees, (elements, times, 2), as OpenDrift 1.14 does or as stated."""
    degrees = np.array(tracks, np.float64)
    longitude, latitude, when = names
    turn = order[0] == "time"
    with nc.Dataset(path, "w") as data:
        data.createDimension("trajectory", len(degrees))
        data.createDimension("time", len(seconds))
        variable = data.createVariable(when, "f8", ("time",))
        if standard_names:
            variable.standard_name = "time"
        of_time = {"units": "seconds since 2026-06-01 12:00", "calendar": "standard", **attributes}
        variable.setncatts({key: value for key, value in of_time.items() if value})
        variable[:] = seconds
        for name, standard, axis in ((longitude, "longitude", 0), (latitude, "latitude", 1)):
            fill = np.nan if dtype[0] == "f" else -(2**31)
            variable = data.createVariable(name, dtype, order, fill_value=fill)
            if standard_names:
                variable.standard_name = standard
            if dtype[0] == "i":
                variable.scale_factor = 1e-7
            values = np.ma.masked_invalid(degrees[..., axis])
            values.data[values.mask] = 0.0
            variable[:] = values.T if turn else values
        if status is not None:
            variable = data.createVariable("status", "i4", order, fill_value=2**31 - 1)
            variable.setncatts(flags)
            values = np.ma.masked_less(np.array(status), 0)
            variable[:] = values.T if turn else values
    return path
