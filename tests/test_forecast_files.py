"""Files of forecasts, written after the conventions of their providers, and those that are refused.

The same velocity is in every file: linear in space and time, to the east and to the north. Grids
of projections hold it along their rows and columns, turned by pyproj.
"""

import math
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import pytest

from DroneSwarmSearch.geo import Origin, read_flow
from DroneSwarmSearch.incident import Incident, simulate

xr = pytest.importorskip("xarray")
pytest.importorskip("netCDF4")

HERE = (60.0, 5.0)
BEGIN = np.datetime64("2026-03-01T00:00", "ns")
HOURS = np.arange(0, 13)
TIMES = BEGIN + HOURS * np.timedelta64(1, "h")
ORIGIN = Origin(HERE, datetime(2026, 3, 1, 2, tzinfo=timezone.utc))
GEOD = pyproj.Geod(ellps="WGS84")


def truth(hours: Any, latitude: Any, longitude: Any) -> Any:
    """The velocity in m/s, (2, ...)."""
    east = 1.0 + 0.5 * (longitude - HERE[1]) + 0.3 * (latitude - HERE[0]) + 0.05 * hours
    north = -0.5 + 0.2 * (longitude - HERE[1]) - 0.4 * (latitude - HERE[0]) - 0.02 * hours
    return np.array([east, north])


def check(path: Path, kind: str, most: float = 2e-3) -> None:
    """The flow of a file is the truth, along the axes of the plane."""
    flow = read_flow(kind, str(path), ORIGIN)
    rng = np.random.default_rng(0)
    points = rng.uniform(-25_000, 25_000, (2, 60))
    latitude, longitude = ORIGIN.plane.degrees(points.T).T
    turned = np.radians(longitude - HERE[1]) * math.sin(math.radians(HERE[0]))
    for hours in (2.0, 4.25, 9.9):
        east, north = truth(hours, latitude, longitude)
        expected = np.array([east - turned * north, north + turned * east])
        seconds = 3600 * (hours - 2)
        assert flow.velocity(seconds, points) == pytest.approx(expected, abs=most)
        each = np.full(60, seconds)
        assert flow.velocity(each, points) == pytest.approx(expected, abs=most)


def on_axes(step: float = 0.1, falling: bool = False, turns: float = 0.0) -> tuple[Any, Any, Any]:
    """Latitudes, longitudes, and the truth on them: (2, times, latitudes, longitudes)."""
    latitude = HERE[0] + np.arange(-8, 9) * step
    longitude = HERE[1] + np.arange(-9, 10) * step
    if falling:
        latitude = latitude[::-1]
    values = truth(*np.meshgrid(HOURS, latitude, longitude, indexing="ij"))
    return latitude, longitude + turns, values


def dataset(
    dims: Any, values: Any, names: Any, coords: Any, attributes: Any = None, **options: Any
) -> Any:
    """Two variables with their coordinates."""
    variables = {
        name: (dims, component, {"units": "m s-1", **(attributes or {}).get(name, {})})
        for name, component in zip(names, values, strict=True)
    }
    return xr.Dataset(variables, coords, **options)


DEGREES = {
    "latitude": {"standard_name": "latitude", "units": "degrees_north"},
    "longitude": {"standard_name": "longitude", "units": "degrees_east"},
}


def regular(names: Any, *, time: str = "time", falling: bool = False, turns: float = 0.0) -> Any:
    """A field on latitudes and longitudes, without standard names."""
    latitude, longitude, values = on_axes(falling=falling, turns=turns)
    coords = {
        time: TIMES,
        "latitude": ("latitude", latitude, DEGREES["latitude"]),
        "longitude": ("longitude", longitude, DEGREES["longitude"]),
    }
    return dataset((time, "latitude", "longitude"), values, names, coords)


def with_dimension(data: Any, name: str, values: Any, index: int, **attributes: Any) -> Any:
    """The same with another dimension, in which only one index has the right values."""
    parts = [data if number == index else 7.0 * data for number in range(len(values))]
    joined = xr.concat(parts, dim=name, coords="minimal", compat="override")
    first = next(iter(data.data_vars.values()))
    joined = joined.transpose(first.dims[0], name, *first.dims[1:])
    return joined.assign_coords({name: (name, values, attributes)})


def projected(proj: str, names: Any, standard: Any, step: float = 4000.0) -> Any:
    """A field on the rows and columns of a projection, along which its components are."""
    project = pyproj.Proj(proj)
    x0, y0 = project(HERE[1], HERE[0])
    x = x0 + np.arange(-16, 17) * step
    y = y0 + np.arange(-15, 16) * step
    return _along_rows(project, x, y, names, standard)


def _along_rows(project: Any, x: Any, y: Any, names: Any, standard: Any) -> Any:
    grid = np.meshgrid(x, y)
    longitude, latitude = project(*grid, inverse=True)
    ahead = project(grid[0] + (x[1] - x[0]) / 100, grid[1], inverse=True)
    azimuth, _, _ = GEOD.inv(longitude, latitude, *ahead)
    angle = np.radians(90 - azimuth)
    east, north = truth(HOURS[:, None, None], latitude, longitude)
    values = (
        east * np.cos(angle) + north * np.sin(angle),
        north * np.cos(angle) - east * np.sin(angle),
    )
    coords = {
        "time": TIMES,
        "x": ("x", x, {"standard_name": "projection_x_coordinate", "units": "m"}),
        "y": ("y", y, {"standard_name": "projection_y_coordinate", "units": "m"}),
        "latitude": (("y", "x"), latitude, {"standard_name": "latitude", **DEGREES["latitude"]}),
        "longitude": (
            ("y", "x"),
            longitude,
            {"standard_name": "longitude", **DEGREES["longitude"]},
        ),
    }
    attributes = {name: {"standard_name": each} for name, each in zip(names, standard, strict=True)}
    return dataset(("time", "y", "x"), values, names, coords, attributes)


LAMBERT = "+proj=lcc +lat_0=63.3 +lon_0=15 +lat_1=63.3 +lat_2=63.3 +R=6371000"
STEREOGRAPHIC = "+proj=stere +lat_0=90 +lon_0=70 +lat_ts=60 +R=6371000"
ROTATED = "+proj=ob_tran +o_proj=longlat +lon_0=-40 +o_lat_p=22 +R=6371000"


def era5_new() -> Any:
    data = regular(("u10", "v10"), time="valid_time", falling=True)
    versions = np.where(HOURS < 6, "0001", "0005")
    return data.assign_coords(number=0, expver=("valid_time", versions))


def era5_old() -> Any:
    """With final and preliminary values side by side."""
    data = regular(("u10", "v10"), falling=True)
    final = data.where(data.time < TIMES[6])
    preliminary = data.where(data.time >= TIMES[6])
    joined = xr.concat([final, preliminary], dim="expver").assign_coords(expver=[1, 5])
    return joined.transpose("time", "expver", "latitude", "longitude")


def gfs_thredds() -> Any:
    names = [f"{part}-component_of_wind_height_above_ground" for part in "uv"]
    data = regular(names, falling=True, turns=360.0)
    levels = [10.0, 20.0, 80.0]
    return with_dimension(data, "height_above_ground2", levels, 0, units="m", positive="up")


def gfs_cfgrib() -> Any:
    data = regular(("u10", "v10"), time="step", falling=True)
    steps = HOURS * np.timedelta64(1, "h")
    return data.assign_coords(
        step=("step", steps.astype("timedelta64[ns]"), {"standard_name": "forecast_period"}),
        time=BEGIN,
        valid_time=("step", TIMES),
        heightAboveGround=10.0,
    )


def meps() -> Any:
    data = projected(LAMBERT, ("x_wind_10m", "y_wind_10m"), ("x_wind", "y_wind"))
    data = with_dimension(data, "height7", [10.0], 0, units="m", positive="up")
    data["projection_lambert"] = ((), 0, pyproj.CRS(LAMBERT).to_cf())
    for name in ("x_wind_10m", "y_wind_10m"):
        data[name].attrs["grid_mapping"] = "projection_lambert"
    return data


def norkyst() -> Any:
    data = projected(STEREOGRAPHIC, ("u", "v"), ("x_sea_water_velocity", "y_sea_water_velocity"))
    return with_dimension(data, "depth", [0.0, 3.0, 10.0], 0, units="m", positive="down")


def norkyst_eastward() -> Any:
    """With components of both kinds."""
    data = norkyst()
    longitude = data.longitude.values
    east, north = truth(HOURS[:, None, None, None], data.latitude.values, longitude)
    for name, values, direction in (("u_eastward", east, "east"), ("v_northward", north, "north")):
        whole = np.broadcast_to(values, data.u.shape)
        standard = {"standard_name": f"{direction}ward_sea_water_velocity", "units": "m s-1"}
        data[name] = (data.u.dims, whole, standard)
        data[["u", "v"][direction == "north"]] *= 5.0
    return data


def rotated() -> Any:
    """The coordinates of the rotated grid are called latitude and longitude, too."""
    project = pyproj.Transformer.from_crs(
        pyproj.CRS("+proj=longlat +R=6371000"), pyproj.CRS(ROTATED), always_xy=True
    )

    def transform(a: Any, b: Any, inverse: bool = False) -> Any:
        return project.transform(a, b, direction="INVERSE" if inverse else "FORWARD")

    x0, y0 = transform(HERE[1], HERE[0])
    data = _along_rows(
        transform,
        x0 + np.arange(-12, 13) * 0.05,
        y0 + np.arange(-12, 13) * 0.05,
        ("u", "v"),
        ("x_wind", "y_wind"),
    )
    for name, role in (("x", "grid_longitude"), ("y", "grid_latitude")):
        data[name].attrs = {"standard_name": role, "units": "degrees"}
    return data


def packed(data: Any) -> dict[str, Any]:
    """How a provider packs values: short integers with a scale."""
    how = {"dtype": "i2", "scale_factor": 2e-4, "add_offset": 0.5, "_FillValue": -32767}
    return dict.fromkeys(data.data_vars, how)


def copernicus() -> Any:
    data = regular(("uo", "vo"))
    data.uo.attrs["standard_name"] = "eastward_sea_water_velocity"
    data.vo.attrs["standard_name"] = "northward_sea_water_velocity"
    return with_dimension(data, "depth", [0.494], 0, units="m", positive="down")


def hycom() -> Any:
    data = regular(("water_u", "water_v"), turns=360.0)
    return with_dimension(data, "depth", [0.0, 2.0, 4.0], 0, units="m", positive="down")


SOURCES = {
    "ERA5, new Climate Data Store": (era5_new, "wind"),
    "ERA5, old, with expver": (era5_old, "wind"),
    "GFS by wgrib2": (
        lambda: regular(("UGRD_10maboveground", "VGRD_10maboveground"), turns=360.0),
        "wind",
    ),
    "GFS by THREDDS": (gfs_thredds, "wind"),
    "GFS by cfgrib": (gfs_cfgrib, "wind"),
    "GFS by run and step": (lambda: gfs_cfgrib().drop_vars("valid_time"), "wind"),
    "MEPS": (meps, "wind"),
    "MEPS, without latitudes": (lambda: meps().drop_vars(["latitude", "longitude"]), "wind"),
    "NorKyst": (norkyst, "current"),
    "NorKyst with both kinds": (norkyst_eastward, "current"),
    "a rotated grid": (rotated, "wind"),
    "Copernicus Marine": (copernicus, "current"),
    "HYCOM": (hycom, "current"),
    "rows from north to south": (lambda: meps().isel(y=slice(None, None, -1)), "wind"),
}


@pytest.mark.thorough
@pytest.mark.parametrize("name", SOURCES)
@pytest.mark.parametrize("is_packed", [False, True])
def test_files_as_their_providers_ship_them(name, is_packed, tmp_path):
    make, kind = SOURCES[name]
    data = make()
    path = tmp_path / "file.nc"
    fields = data[[each for each in data.data_vars if data[each].ndim > 1]]
    data.to_netcdf(path, encoding=packed(fields) if is_packed else {})
    check(path, kind)


def test_members_are_shared_out_among_particles(tmp_path):
    """Their spread is the error: no other is added unless it is given."""
    data = regular(("uo", "vo")) * 0.0
    members = [data + shift for shift in (-0.2, 0.0, 0.4)]
    path = tmp_path / "ensemble.nc"
    xr.concat(members, dim="number").assign_coords(number=[0, 1, 2]).to_netcdf(path)
    flow = read_flow("current", str(path), ORIGIN)
    assert flow.members == 3
    points = np.zeros((2, 6))
    of_each = flow.velocity(3600.0, points, np.arange(6) % 3)
    assert of_each[0] == pytest.approx([-0.2, 0.0, 0.4] * 2, abs=1e-6)
    assert flow.velocity(3600.0, points)[0] == pytest.approx(0.2 / 3, abs=1e-6)
    incident = Incident(
        position=HERE,
        time="2026-03-01T02:00Z",
        start="2026-03-01T03:00Z",
        object_class="PIW-1",
        wind=(0, 0),
        wind_error=0,
        current=path,
        position_error=10,
        coast="none",
        drones=1,
    )
    assert incident.current_error == 0
    assert "3 members" in incident.sentence
    cloud = simulate(incident, 600, 0)
    drift = cloud.at(3600 + 1800)[:, 0].reshape(-1, 3).mean(axis=0)
    assert drift == pytest.approx(np.array([-0.2, 0.0, 0.4]) * 5400, abs=60)


def test_a_tide_in_hourly_values_loses_at_most_a_hundredth(tmp_path):
    period = 12.42
    data = regular(("uo", "vo")) * 0.0
    tide = xr.DataArray(np.cos(2 * np.pi * HOURS / period), dims="time")
    path = tmp_path / "tide.nc"
    (data + tide).to_netcdf(path)
    flow = read_flow("current", str(path), ORIGIN)
    seconds = np.arange(0, 6 * 3600, 300.0)
    given = np.cos(2 * np.pi * (seconds / 3600 + 2) / period)
    read = np.array([flow.velocity(each, np.zeros((2, 1)))[0, 0] for each in seconds])
    assert abs(read - given).max() < 0.01
    assert (read @ given) / (given @ given) > 0.99


def on_levels(name: str, values: Any, units: str) -> Any:
    return with_dimension(regular(("u10", "v10")), name, values, 0, units=units)


def several_runs() -> Any:
    data = gfs_cfgrib().drop_vars("valid_time")
    later = data.assign_coords(time=BEGIN + np.timedelta64(6, "h"))
    return xr.concat([data, later], dim="time", coords="minimal", compat="override")


def overlapping_runs() -> Any:
    data = regular(("u10", "v10"))
    return xr.concat([data.isel(time=slice(0, 9)), data.isel(time=slice(6, None))], dim="time")


def staggered() -> Any:
    u, v = on_axes()[2]
    return xr.Dataset(
        {
            "u": (("ocean_time", "eta_u", "xi_u"), u[:, :, :-1]),
            "v": (("ocean_time", "eta_v", "xi_v"), v[:, :-1]),
        },
        {"ocean_time": TIMES},
    )


def in_knots() -> Any:
    data = regular(("u10", "v10"))
    data.u10.attrs["units"] = "knots"
    return data


def with_values(change: Any) -> Any:
    data = regular(("u10", "v10"))
    change(data.u10.values)
    return data


def set_hour(values: Any) -> None:
    values[5] = np.nan


def set_undeclared(values: Any) -> None:
    values[5, 3, 4] = 9999.0


REFUSED = {
    "pressure levels": (
        lambda: on_levels("isobaricInhPa", [1000.0, 925.0], "hPa"),
        "wind must be at a height in metres, got u10 on isobaricInhPa, 2 levels in hPa in ",
    ),
    "model levels": (
        lambda: on_levels("hybrid", [65, 64], "1"),
        "wind must be at a height in metres, got u10 on hybrid, 2 levels in 1",
    ),
    "sigma, one level": (
        lambda: on_levels("sigma", [0.995], "sigma"),
        "wind must be at a height in metres, got u10 on sigma",
    ),
    "another height": (
        lambda: on_levels("height", [2.0, 80.0], "m"),
        "wind must be at 10 m, got u10 with height 2, 80 in",
    ),
    "another height, without a dimension": (
        lambda: regular(("u10", "v10")).assign_coords(heightAboveGround=100.0),
        "wind must be at 10 m, got u10 with heightAboveGround 100 in",
    ),
    "several runs": (
        several_runs,
        r"wind must be one run, got u10 on .*time \(2\).* in .*: save one run, without the dim",
    ),
    "overlapping runs": (
        overlapping_runs,
        "given once for each time, got u10 for 2026-03-01 06:00 UTC from several runs",
    ),
    "a gap": (
        lambda: regular(("u10", "v10")).isel(time=[0, 1, 2, 3, 8, 9, 10, 11, 12]),
        "given every 1 h, got u10 for 2026-03-01 03:00 UTC and then for 2026-03-01 08:00 UTC",
    ),
    "an hour without values": (
        lambda: with_values(set_hour),
        "known at every time, got u10 and v10 without any value for 2026-03-01 05:00 UTC",
    ),
    "an undeclared fill value": (
        lambda: with_values(set_undeclared),
        "wind must be at most 75 m/s fast, got .* with 9999 m/s in .*: declare the value",
    ),
    "another dimension": (
        lambda: with_dimension(regular(("u10", "v10")), "direction", [0, 90], 0),
        r"got u10 with the dimension direction of 2 in .*: save one of them",
    ),
    "another unit": (
        in_knots,
        "wind must be in m/s, got u10 in knots",
    ),
    "other names": (
        lambda: regular(("a", "b")),
        r"variables called u10 and v10, .* got .* with a \(no standard name\), b .*: rename them",
    ),
    "no latitudes": (
        lambda: projected(LAMBERT, ("u10", "v10"), ("x_wind", "y_wind")).drop_vars(
            ["latitude", "longitude"]
        ),
        "wind must be on axes of time, latitude and longitude, got u10 on time",
    ),
    "a single time": (
        lambda: regular(("u10", "v10")).isel(time=[3]),
        "given for at least two times, got 1",
    ),
    "a calendar without leap years": (
        lambda: regular(("u10", "v10")).convert_calendar("noleap", use_cftime=True),
        "times of the usual calendar",
    ),
    "elsewhere": (
        lambda: regular(("u10", "v10")).assign_coords(latitude=np.linspace(20, 30, 17)),
        r"wind must cover the position, \(60.0, 5.0\), but .* has latitude from 20.00 to 30.00",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_other_files_are_refused_in_words(name, tmp_path):
    make, message = REFUSED[name]
    path = tmp_path / "file.nc"
    make().to_netcdf(path)
    with pytest.raises(ValueError, match=message) as caught:
        read_flow("wind", str(path), ORIGIN)
    assert "file.nc" in str(caught.value)


def test_staggered_grids_are_refused(tmp_path):
    path = tmp_path / "roms.nc"
    staggered().to_netcdf(path)
    with pytest.raises(ValueError, match=r"current must be on one grid, got u on .* u_eastward"):
        read_flow("current", str(path), ORIGIN)


@pytest.mark.parametrize(
    ("time", "start", "message"),
    [
        ("2026-03-01T11:00Z", "2026-03-01T11:30Z", "from 2026-03-01 11:00 to 2026-03-01 12:06"),
        ("2026-02-28T23:00Z", "2026-03-01T01:00Z", "from 2026-02-28 23:00"),
    ],
)
def test_a_file_that_does_not_cover_the_drift_is_refused(time, start, message, tmp_path):
    path = tmp_path / "wind.nc"
    regular(("u10", "v10")).to_netcdf(path)
    with pytest.raises(ValueError, match=rf"wind must cover the drift, {message}.* covers only "):
        Incident(position=HERE, time=time, start=start, object_class="PIW-1", wind=path)


def test_grib(tmp_path):
    """Wind at 10 m beside a temperature at 2 m, as in a file of GFS."""
    pytest.importorskip("cfgrib")
    from eccodes import (
        codes_grib_new_from_samples,
        codes_release,
        codes_set,
        codes_set_values,
        codes_write,
    )

    latitude, longitude, values = on_axes(falling=True)
    path = tmp_path / "gfs.grib2"
    with path.open("wb") as file:
        for number, field in ((165, values[0]), (166, values[1]), (167, values[0] + 280)):
            for hour in HOURS:
                message = codes_grib_new_from_samples("regular_ll_sfc_grib2")
                keys = {
                    "dataDate": 20260301,
                    "dataTime": 0,
                    "stepRange": str(hour),
                    "Ni": len(longitude),
                    "Nj": len(latitude),
                    "latitudeOfFirstGridPointInDegrees": latitude[0],
                    "latitudeOfLastGridPointInDegrees": latitude[-1],
                    "longitudeOfFirstGridPointInDegrees": longitude[0],
                    "longitudeOfLastGridPointInDegrees": longitude[-1],
                    "iDirectionIncrementInDegrees": 0.1,
                    "jDirectionIncrementInDegrees": 0.1,
                    "paramId": number,
                    "bitsPerValue": 20,
                }
                for key, value in keys.items():
                    codes_set(message, key, value)
                codes_set_values(message, field[hour].ravel())
                codes_write(message, file)
                codes_release(message)
    check(path, "wind")
