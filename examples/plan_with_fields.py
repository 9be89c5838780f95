"""Plan with fields of current and wind, from two files that this script makes.

    pip install "DroneSwarmSearchEnvironment[plan,tracks]"
    python examples/plan_with_fields.py --out runs/strait

A tide of one knot and a half runs between two coasts, with an eddy in its middle; the wind grows
towards the east. The files have the names and units of the CF conventions, as those of ocean and
weather models. The drift of the particles without errors is compared with a fine integration of the
same currents, and their plan is written.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

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


def write_field(path: Path, field: Any, names: tuple[str, str], points: int) -> None:
    """Write a field every half hour, on a grid of some points along each axis."""
    latitudes = MIDDLE[0] + np.linspace(-0.3, 0.3, points)
    longitudes = MIDDLE[1] + np.linspace(-0.5, 0.5, points)
    axes = {"time": HOURS, "latitude": latitudes, "longitude": longitudes}
    units = "hours since 2026-03-01", "degrees_north", "degrees_east"
    with netCDF4.Dataset(path, "w") as data:
        data.title = path.stem
        for (name, values), unit in zip(axes.items(), units, strict=True):
            data.createDimension(name, len(values))
            data.createVariable(name, "f8", (name,))[:] = values
            data[name].units = unit
        grid = np.meshgrid(3600 * HOURS, latitudes, longitudes, indexing="ij")
        for name, values in zip(names, field(*grid), strict=True):
            variable = data.createVariable(name, "f4", (*axes,), fill_value=1e20)
            variable.standard_name = name
            variable.units = "m s-1"
            variable[:] = np.ma.masked_invalid(values)


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
    names = "eastward_sea_water_velocity", "northward_sea_water_velocity"
    write_field(folder / "ocean.nc", current, names, 300)
    write_field(folder / "weather.nc", wind, ("x_wind", "y_wind"), 30)
    incident = Incident(
        position=(54.19, 4.86),
        time="2026-03-01T01:00Z",
        start="2026-03-01T03:00Z",
        object_class="LIFE-RAFT-SB-6",
        position_sd=300,
        wind=folder / "weather.nc",
        current=folder / "ocean.nc",
        drones=2,
    )
    still = Incident(
        position=incident.position,
        time=incident.time,
        start=incident.start,
        object_class="PIW-1",
        position_sd=0,
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
    print(incident.sentence, *flights.orders, *flights.assumptions, sep="\n")
    print(f"probability of success: {flights.probability_of_success:.0%}")


if __name__ == "__main__":
    main()
