"""Fields of current and wind: files of several conventions, land, and persons who drift in them."""

import math
from datetime import datetime, timezone
from typing import Any

import numpy as np
import pytest

from DroneSwarmSearch.geo import Field, Origin
from DroneSwarmSearch.incident import Incident, drone_in_wind, simulate
from DroneSwarmSearch.incident import plan as plan_flights
from DroneSwarmSearch.incident.files import chart

nc = pytest.importorskip("netCDF4")

HERE = (54.2, 7.9)
HOURS = np.arange(0.0, 9.0, 0.5)
CURRENT = "eastward_sea_water_velocity", "northward_sea_water_velocity"
MIDNIGHT = datetime(2026, 3, 1, tzinfo=timezone.utc)
KNOWN: dict[str, Any] = {
    "position": HERE,
    "time": "2026-03-01T01:00Z",
    "start": "2026-03-01T03:00Z",
    "night": True,
    "object_class": "PIW-1",
    "wind": (0, 0),
    "wind_error": 0,
    "current_error": 0,
    "position_error": 100,
    "endurance": 1800,
    "drones": 1,
    "coast": "none",
}


def shear(seconds: Any, latitude: Any, longitude: Any) -> Any:
    """To the east in the north, to the west in the south, linear; and slowly more northward."""
    return np.array([10 * (latitude - HERE[0]) + 0.2, 0 * latitude + 1e-5 * seconds])


def eddy(seconds: Any, latitude: Any, longitude: Any) -> Any:
    """A rigid rotation around a position 2 km south of HERE, in four hours."""
    y = (latitude - HERE[0]) * 111_300 + 2000
    x = (longitude - HERE[1]) * 111_300 * math.cos(math.radians(HERE[0])) * 1.0028
    return 2 * math.pi / 14_400 * np.array([-y, x])


def strait(seconds: Any, latitude: Any, longitude: Any) -> Any:
    """To the north, up to a coast 2 km north of the position."""
    return np.where(latitude > HERE[0] + 2000 / 111_300, np.nan, [0 * latitude, 0.5 + 0 * latitude])


def write(
    path,
    field,
    names=CURRENT,
    *,
    points=61,
    half=(0.15, 0.25),
    middle=HERE[1],
    order=("time", "depth", "lat", "lon"),
    level=("depth", [0.5, 10.0, 50.0]),
    backwards=False,
    circle=False,
    packed=False,
    seconds="hours since 2026-03-01 00:00",
    **attributes,
):
    """Write a field on axes in some order; only its level nearest to the sea's surface is right."""
    axes = {
        "time": HOURS * (60 if seconds.startswith("min") else 1),
        "lat": HERE[0] + half[0] * np.linspace(-1, 1, points),
        "lon": HERE[1] + half[1] * np.linspace(-1, 1, points),
        level[0]: level[1],
    }
    if backwards:
        axes["lat"] = axes["lat"][::-1]
    grid = np.meshgrid(3600 * HOURS, axes["lat"], axes["lon"], indexing="ij")
    units = {"time": seconds, "lat": "degrees_north", "lon": "degrees_east", level[0]: "m"}
    with nc.Dataset(path, "w") as data:
        data.title = "A model"
        for name in order:
            values = np.asarray(axes[name]) + (middle - HERE[1] if name == "lon" else 0)
            data.createDimension(name, len(values))
            variable = data.createVariable(name, "f8", (name,))
            variable.units = units[name]
            variable[:] = values % 360 if circle and name == "lon" else values
        for name, values in zip(names, field(*grid), strict=True):
            usual = [each for each in ("time", "lat", "lon") if each in order]
            if level[0] in order:
                best = np.abs(np.abs(level[1]) - (10 if level[0] == "height" else 0)).argmin()
                right = (np.arange(len(level[1])) == best)[:, None, None]
                values = values[:, None] * np.where(right, 1, 7)
                usual = ["time", level[0], "lat", "lon"]
            values = values.transpose([usual.index(each) for each in order])
            kind, fill = ("i2", -32768) if packed else ("f4", 1e20)
            variable = data.createVariable(f"var_{name}", kind, order, fill_value=fill)
            if packed:
                variable.scale_factor = 2e-4
                variable.add_offset = 0.5
            variable.setncatts({"standard_name": name, "units": "m s-1", **attributes})
            variable[:] = np.ma.masked_invalid(values)
    return path


@pytest.mark.parametrize(
    ("options", "middle"),
    [
        ({}, HERE[1]),
        ({"order": ("lon", "time", "lat")}, HERE[1]),
        ({"order": ("lat", "depth", "lon", "time"), "backwards": True, "packed": True}, HERE[1]),
        ({"circle": True}, -0.1),  # its longitudes begin anew at the position
        ({"circle": True, "points": 60}, -120.0),
        ({}, 180.0),
        ({"circle": True}, -179.99),
        ({"seconds": "minutes since 2026-03-01 01:00 +01:00"}, HERE[1]),
        ({"level": ("depth", [-50.0, -1.0]), "order": ("depth", "time", "lat", "lon")}, HERE[1]),
    ],
    ids=str,
)
def test_files_of_many_conventions_are_read(options, middle, tmp_path):
    path = write(tmp_path / "a.nc", shear, middle=middle, **options)
    field = Field.read(path, "current", Origin((HERE[0], middle), MIDNIGHT))
    rng = np.random.default_rng(0)
    latitude = HERE[0] + rng.uniform(-0.1, 0.1, 50)
    longitude = middle + rng.uniform(-0.2, 0.2, 50)
    # North of the plane is north at its origin; elsewhere, the meridians have turned.
    turned = np.radians(longitude - middle) * math.sin(math.radians(HERE[0]))
    east, north = shear(9000.0, latitude, longitude)
    expected = np.array([east - turned * north, north + turned * east])
    points = field.origin.plane.metres(latitude, longitude).T
    assert field.velocity(9000.0, points) == pytest.approx(expected, abs=3e-4)
    several = field.velocity(np.full(50, 9000.0), points)
    assert several == pytest.approx(expected, abs=3e-4)


def test_values_are_interpolated_up_to_the_last_of_each_axis(tmp_path):
    def last(seconds: Any, latitude: Any, longitude: Any) -> Any:
        """Nothing but for the last value of each axis."""
        return np.array([axis == axis.max() for axis in (seconds, latitude)], float)

    field = Field.read(write(tmp_path / "a.nc", last), "current", Origin(HERE, MIDNIGHT))
    latitude = HERE[0] + np.array([0.0, 0.15 - 0.005 / 4])
    longitude = np.full(2, HERE[1])
    points = field.origin.plane.metres(latitude, longitude).T
    end = 3600 * HOURS[-1]
    step = 1800.0
    # A quarter of the interval before the last time, the cubic is 93/128 of the last value.
    rest = 93 / 128
    for before, expected in ((0.25, [[rest, rest], [0, 0.75]]), (1.0, [[0, 0], [0, 0.75]])):
        flow = field.velocity(end - before * step, points)
        assert flow == pytest.approx(np.array(expected), abs=1e-3)


@pytest.mark.thorough
@pytest.mark.parametrize(("field", "most"), [(shear, 0.005), (eddy, 0.01)])
def test_particles_follow_the_exact_tracks(field, most, tmp_path):
    """Both fields are linear, so the mean of the particles drifts as a single one would."""
    path = write(tmp_path / "ocean.nc", field, half=(0.06, 0.1))
    incident = Incident(**KNOWN, current=path)
    cloud = simulate(incident, 20_000, 0)
    place = np.zeros(2)
    way = 0.0
    for seconds in np.arange(3600.0, 3 * 3600.0, 5.0):
        middle = place + 2.5 * field(seconds, *incident.plane.degrees(place))
        move = 5 * field(seconds + 2.5, *incident.plane.degrees(middle))
        place = place + move
        way = way + float(np.hypot(*move))
    assert cloud.mean(7200) == pytest.approx(place, abs=most * way + 5)
    assert way > 1000


@pytest.mark.thorough
def test_persons_strand_and_are_found_ashore(tmp_path):
    incident = Incident(**KNOWN, current=write(tmp_path / "ocean.nc", strait, points=121))
    cloud = simulate(incident, 5000, 0)
    assert cloud.ashore > 0.95
    assert cloud.at(9000)[:, 1] == pytest.approx(2000, abs=200)
    assert (cloud.at(9000) == cloud.at(8700)).mean() > 0.95
    plan = plan_flights(incident)
    assert plan.probability_of_success > 0.6
    assert any(" of the persons strand by 03:" in each for each in plan.assumptions)
    assert "current of A model, 2026-03-01 00:00 to 2026-03-01 08:30 UTC" in incident.sentence
    assert chart.draw(plan, [0]).axes[0].get_legend_handles_labels()[1][2].startswith("current at")


@pytest.mark.thorough
def test_drones_fly_in_the_wind_of_the_file(tmp_path):
    """At 10 m and above, at their places and times."""
    names = "x_wind", "y_wind"
    level = ("height", [2.0, 10.0, 100.0])
    order = ("time", "height", "lat", "lon")
    path = write(tmp_path / "weather.nc", shear, names, level=level, order=order)
    incident = Incident(**{**KNOWN, "wind": str(path)})
    drone = drone_in_wind(incident, 0)
    places = np.array([[0.0, 500.0], [3000.0, -3000.0]])
    blown = drone.wind(np.array([0.0, 1800.0]), places)
    degrees = incident.plane.degrees(places.T).T
    expected = shear(np.array([3 * 3600.0, 3.5 * 3600.0]), *degrees) * 10**0.11
    assert blown == pytest.approx(expected, abs=1e-3)
    assert plan_flights(incident).probability_of_success > 0
    assert simulate(Incident(**KNOWN), 100, 0).ashore == 0


@pytest.mark.thorough
def test_files_need_to_cover_the_persons_only(tmp_path):
    """Not all flights that drones try, nor the hours after the last landing, nor the whole map."""
    path = write(tmp_path / "weather.nc", shear, ("x_wind", "y_wind"), points=61)
    ocean = write(tmp_path / "ocean.nc", shear)
    known = {**KNOWN, "time": "2026-03-01T07:00Z", "start": "2026-03-01T07:55Z", "swath": 500}
    incident = Incident(
        **{**known, "wind": path, "speed": 60, "position_error": 3000}, current=ocean
    )
    plan = plan_flights(incident)
    assert plan.probability_of_success > 0
    chart.draw(plan, [0])


def test_an_incident_with_fields_survives_its_file(tmp_path):
    incident = Incident(**KNOWN, current=write(tmp_path / "ocean.nc", shear))
    incident.write(tmp_path / "plan" / "incident.json")
    assert '"../ocean.nc"' in (tmp_path / "plan" / "incident.json").read_text("utf-8")
    assert Incident.read(tmp_path / "plan" / "incident.json") == incident


@pytest.mark.parametrize(
    ("values", "options", "message"),
    [
        ({"position": (54.24, 7.9)}, {}, "position must be at sea, but .* has no current at"),
        (
            {"position": (50.0, 7.9)},
            {},
            "current must cover the position, .* lat .* 54.05 to 54.35",
        ),
        ({"position": (54.2, 9.9)}, {}, "current must cover the position, .* lon .* 7.65 to 8.15"),
        (
            {"start": "2026-03-01T09:00Z"},
            {},
            "must cover the drift, .* but .* covers only 2026-03-01 00:00 to 2026-03-01 08:30 UTC",
        ),
        ({}, {"names": ("x_wind", "y_wind")}, "current must be a file with one variable of the st"),
        ({}, {"units": "knots"}, "current must be in m/s, got .* in knots"),
        ({}, {"order": ("lat", "lon")}, r"current must be on one axis of time, got .* lat \(61\)"),
    ],
)
def test_unsuitable_files_are_refused(values, options, message, tmp_path):
    still = strait if "order" not in options else lambda *grid: strait(*grid)[:, 0]
    path = write(tmp_path / "ocean.nc", still, **options)
    with pytest.raises(ValueError, match=message):
        simulate(Incident(**{**KNOWN, **values}, current=path), 100, 0)
