"""Plan with fields of current and wind, from two files that this script makes.

    pip install "DroneSwarmSearchEnvironment[plan,tracks]"
    python examples/plan_with_fields.py --out runs/strait

A tide of one knot and a half runs between two coasts, with an eddy in its middle; the wind grows
towards the east. The files are as Copernicus Marine and the Climate Data Store ship theirs. The
drift of the particles without errors is compared with a fine integration of the same currents, and
their plan is written.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from DroneSwarmSearch.geo.plane import TangentPlane
from DroneSwarmSearch.incident import Incident, plan, simulate, write

MIDDLE = 54.2, 4.9  # far from real coasts
COAST = 0.06  # degrees of latitude to either side
PLANE = TangentPlane(*MIDDLE)
HOURS = np.arange(0.0, 13.0, 0.5)


def current(seconds: Any, latitude: Any, longitude: Any) -> Any:
    """The current (east, north) in m/s; NaN on land."""
    x, y = np.moveaxis(PLANE.metres(latitude, longitude), -1, 0)
    turning = 0.4 / 3000 * np.exp(0.5 * (1 - (x**2 + y**2) / 3000**2))
    tide = 0.75 * np.cos(2 * np.pi * seconds / 44_714)  # of the moon
    on_land = np.abs(latitude - MIDDLE[0]) > COAST
    return np.where(on_land, np.nan, [tide - turning * y, turning * x])


def wind(seconds: Any, latitude: Any, longitude: Any) -> Any:
    """The wind (east, north) in m/s."""
    return np.array([6 + 5 * (longitude - MIDDLE[1]), -3 + 0 * latitude])


def write_ocean(path: Path) -> None:
    """Write the current as Copernicus Marine ships it: packed, with one depth; land is missing."""
    axes, (east, north) = field(current, 300)
    dimensions = ("time", "depth", "latitude", "longitude")
    variables = {
        "uo": (dimensions, east[:, None], {"standard_name": "eastward_sea_water_velocity"}),
        "vo": (dimensions, north[:, None], {"standard_name": "northward_sea_water_velocity"}),
    }
    data = xr.Dataset(variables, coords={**axes, "depth": [0.49]})
    data["depth"].attrs = {"units": "m", "positive": "down", "axis": "Z"}
    packing = {"dtype": "i2", "scale_factor": 0.0001, "add_offset": 0.0, "_FillValue": -32767}
    for name in variables:
        data[name].attrs["units"] = "m s-1"
    data.to_netcdf(path, encoding=dict.fromkeys(variables, packing))


def write_weather(path: Path) -> None:
    """Write the wind as the Climate Data Store ships ERA5: latitudes fall, with `valid_time`."""
    axes, (east, north) = field(wind, 30)
    dimensions = ("valid_time", "latitude", "longitude")
    variables = {"u10": (dimensions, east), "v10": (dimensions, north)}
    times = axes.pop("time")
    coordinates = {"number": 0, "valid_time": times, **axes}
    data = xr.Dataset(variables, coords=coordinates).isel(latitude=slice(None, None, -1))
    for name in variables:
        data[name].attrs = {"units": "m s**-1", "GRIB_typeOfLevel": "surface"}
    data.coords["expver"] = ("valid_time", ["0001"] * len(HOURS))
    data.to_netcdf(path)


def field(velocity: Any, points: int) -> tuple[dict[str, Any], Any]:
    """Axes, and a velocity every half hour on a grid of some points along each axis."""
    latitudes = MIDDLE[0] + np.linspace(-0.3, 0.3, points)
    longitudes = MIDDLE[1] + np.linspace(-0.5, 0.5, points)
    grid = np.meshgrid(3600 * HOURS, latitudes, longitudes, indexing="ij")
    times = np.datetime64("2026-03-01", "ns") + (3600 * HOURS).astype("timedelta64[s]")
    axes = {"time": times, "latitude": latitudes, "longitude": longitudes}
    return axes, velocity(*grid)


def integrated(places: Any, begin: float, end: float, step: float = 10.0) -> Any:
    """Where currents and turbulence, of 5 m²/s, take positions in metres, (n, 2)."""
    rng = np.random.default_rng(0)
    for seconds in np.arange(begin, end, step):
        half = places + step / 2 * np.nan_to_num(current(seconds, *PLANE.degrees(places).T)).T
        moves = step * np.nan_to_num(current(seconds + step / 2, *PLANE.degrees(half).T)).T
        places = places + moves + rng.normal(0, np.sqrt(10 * step), places.shape)
    return places


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="the folder to write")
    folder = parser.parse_args().out
    folder.mkdir(parents=True, exist_ok=True)
    write_ocean(folder / "ocean.nc")
    write_weather(folder / "weather.nc")
    incident = Incident(
        position=(54.19, 4.86),
        time="2026-03-01T01:00Z",
        start="2026-03-01T03:00Z",
        object_class="LIFE-RAFT-SB-6",
        position_error=300,
        wind=folder / "weather.nc",
        current=folder / "ocean.nc",
        drones=2,
        night=True,
    )
    still = Incident(
        position=incident.position,
        time=incident.time,
        start=incident.start,
        object_class="PIW-1",
        position_error=0,
        wind=(0, 0),
        current=folder / "ocean.nc",
        wind_error=0,
        current_error=0,
    )
    begin = 3600.0
    end = 3 * 3600.0
    there = still.plane.degrees(simulate(still, 20_000, 0).mean(end - begin))
    start = PLANE.metres(*incident.position)
    exact = integrated(np.tile(start, (5000, 1)), begin, end).mean(axis=0)
    off = np.hypot(*(PLANE.metres(*there) - exact))
    way = np.hypot(*(exact - start))
    print(f"after 2 hours, the particles' mean is {off:.0f} m from the exact one, {way:.0f} m away")
    flights = plan(incident)
    write(flights, folder / "plan")
    print(incident.sentence, *flights.briefing, *flights.orders, *flights.assumptions, sep="\n")
    print(f"probability of success: {flights.probability_of_success:.0%}")


if __name__ == "__main__":
    main()
