"""Coasts: persons start at sea and strand, and what plans say and draw of land."""

import json
import math
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from DroneSwarmSearch import DroneSwarmSearch, Scenario
from DroneSwarmSearch.cli import main
from DroneSwarmSearch.core import NamedSearch
from DroneSwarmSearch.evaluation import search as named_search
from DroneSwarmSearch.geo import TangentPlane, land_around
from DroneSwarmSearch.incident import (
    PARALLEL,
    Coast,
    Incident,
    Pattern,
    begun_at_sea,
    drone_in_wind,
    locate,
    plan,
    search_on_grid,
    simulate,
    write,
)
from DroneSwarmSearch.rendering import Look, render_text
from DroneSwarmSearch.rendering.painter import Painter

pytest.importorskip("cmaes")

HERE = (54.0, 5.0)
STILL: dict[str, Any] = {
    "position": HERE,
    "time": "2026-03-01T05:30Z",
    "object_class": "PIW-1",
    "wind": (0, 0),
    "wind_error": 0,
    "current_error": 0,
    "position_error": 100,
    "endurance": 1800,
    "drones": 1,
}
SHORE = 500.0  # metres north of HERE


def polygon(*corners: tuple[float, float]) -> dict[str, Any]:
    """A GeoJSON polygon through corners in metres (east, north) of HERE."""
    outline = shapely.segmentize(shapely.LinearRing(corners), 500.0)  # bent in degrees
    degrees = TangentPlane(*HERE).degrees(shapely.get_coordinates(outline))
    ring = [[longitude, latitude] for latitude, longitude in degrees.tolist()]
    return {"type": "Polygon", "coordinates": [ring]}


NORTH = polygon((-40_000, SHORE), (40_000, SHORE), (40_000, 40_000), (-40_000, 40_000))
"""Land from 500 m north of HERE on."""


@pytest.fixture
def north(tmp_path) -> str:
    path = tmp_path / "north.geojson"
    path.write_text(json.dumps({"type": "Feature", "geometry": NORTH, "properties": {}}))
    return str(path)


@pytest.mark.thorough
@pytest.mark.parametrize(
    "position",
    [
        (54.18, 7.88),  # an island
        (-16.75, 179.99),  # islands on both sides of the date line
        (-16.75, -179.99),
        (-78.1, 179.0),  # a coast
        (-88.9, 30.0),  # beside the South Pole
        (53.7, 8.25),  # the corner of a continent
    ],
)
def test_points_are_on_land_exactly_where_the_polygons_are(position):
    """Most points are decided by squares; all agree with the polygons themselves."""
    land = land_around("gshhg", position, 20_000)
    assert land is not None
    points = np.random.default_rng(0).uniform(-20_000, 20_000, (2, 4000))
    inside = land.contains(points)
    assert (inside == shapely.contains_xy(land.shape, *points)).all()
    assert inside.any()
    # In degrees, against the coastline as it is given.
    degrees = TangentPlane(*position).degrees(points.T)
    given = shapely.from_wkb(sys.modules["roaring_landmask"].Shapes.wkb("small"))
    by_degrees = shapely.contains_xy(given, degrees[:, 1], degrees[:, 0])
    assert (by_degrees == inside).mean() > 0.999


def test_the_coast_is_kept_in_the_cache(monkeypatch):
    position = (-16.76, 179.97)
    first = land_around("gshhg", position, 30_000)
    monkeypatch.setattr(sys.modules["roaring_landmask"].Shapes, "wkb", None)
    again = land_around("gshhg", position, 30_000)
    assert first is not None and again is not None
    assert first.shape.equals(again.shape)


def test_how_far_inland(north):
    land = land_around(north, HERE, 30_000)
    assert land is not None
    assert land.distance_to_sea((0, 0)) == 0
    assert land.distance_to_sea((3000, SHORE + 2000)) == pytest.approx(2000, abs=1)


def test_persons_start_at_sea_and_strand_on_shores(north):
    values = {**STILL, "position_error": 400, "current": (0.0, 0.5), "coast": north}
    cloud = simulate(Incident(**values), 3000, 0)
    assert (cloud.positions[1] < SHORE).all()
    # In an hour, the current carries persons 1.8 km to the north.
    still_adrift = cloud.positions[1, 0] < cloud.positions[1, -1]
    assert cloud.ashore > 0.95
    assert still_adrift.mean() < 0.1
    stranded = cloud.positions[1, -1][~still_adrift]
    assert np.percentile(SHORE - stranded, 95) < 100
    free = simulate(Incident(**{**values, "coast": "none"}), 3000, 0)
    assert free.ashore == 0
    assert (free.positions[1, 0] > SHORE).any()


@pytest.mark.thorough
def test_stranded_persons_are_found(north):
    made = plan(Incident(**{**STILL, "current": (0.0, 0.5), "coast": north}))
    assert made.probability_of_success > 0.6
    assert any(" of the persons strand by " in each for each in made.assumptions)


class TestPosition:
    def test_on_land_it_is_refused_with_the_distance(self, north):
        inland = TangentPlane(*HERE).degrees((0.0, SHORE + 12_000))
        incident = Incident(**{**STILL, "position": tuple(inland.tolist()), "coast": north})
        for use in (plan, search_on_grid):
            with pytest.raises(
                ValueError, match=r"^position must be at sea.*which is 12 km inland"
            ):
                use(incident)

    def test_nearer_to_the_sea_than_its_error_it_is_taken(self, north):
        inland = tuple(TangentPlane(*HERE).degrees((0.0, SHORE + 300)).tolist())
        values = {**STILL, "position": inland, "coast": north}
        with pytest.raises(ValueError, match=r"100 m, got .* which is 300 m inland"):
            simulate(Incident(**values), 10, 0)
        cloud = simulate(Incident(**{**values, "position_error": 310}), 500, 0)
        assert (cloud.positions[1, 0] < -300 + 1).all()

    def test_of_tracks_and_without_a_coast_it_is_taken(self, north):
        inland = TangentPlane(*HERE).degrees((0.0, SHORE + 12_000))
        values = {**STILL, "position": tuple(inland.tolist()), "coast": "none"}
        assert simulate(Incident(**values), 10, 0).ashore == 0


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("no JSON", "cannot be read"),
        ("[1, 2]", "holds no polygons"),
        ('{"type": "FeatureCollection", "features": []}', "holds no polygons"),
        ('{"type": "LineString", "coordinates": [[0, 0], [1, 1]]}', "holds a LineString"),
        ('{"type": "Polygon", "coordinates": [[[0, 0]]]}', "holds what is no geometry"),
        ('{"type": "Polygon"}', "holds what is no geometry"),
        (
            '{"type": "Polygon", "coordinates": [[[6e5, 6e6], [7e5, 6e6], [7e5, 7e6]]]}',
            "must be in degrees, longitude first",
        ),
    ],
)
def test_files_that_are_no_coast_are_refused(tmp_path, content, message):
    path = tmp_path / "coast.json"
    path.write_text(content)
    with pytest.raises(ValueError, match=rf"^coast must be .*coast\.json' {message}"):
        simulate(Incident(**STILL, coast=path), 10, 0)


@pytest.mark.parametrize(
    ("value", "error", "message"),
    [
        (
            "osm",
            ValueError,
            "coast must be 'gshhg', 'none' or a GeoJSON file, but there is no 'osm'",
        ),
        (None, TypeError, "coast must be .*, got None"),
        (3, TypeError, "coast must be .*, got 3"),
    ],
)
def test_other_coasts_are_refused(value, error, message):
    with pytest.raises(error, match=message):
        Incident(**STILL, coast=value)


def test_without_the_package_the_error_says_what_to_do(monkeypatch):
    monkeypatch.setitem(sys.modules, "roaring_landmask", None)
    with pytest.raises(
        ImportError, match=r"roaring-landmask; without it, give coast as .*\[plan\]"
    ):
        simulate(Incident(**{**STILL, "position": (53.9, 5.1)}), 10, 0)
    assert simulate(Incident(**STILL, coast="none"), 10, 0).ashore == 0


class TestCommenceSearchPoint:
    def pattern(self, start: tuple[float, float], heading: float, **values: Any) -> Pattern:
        usual = {"length": 2000.0, "spacing": 150.0, "legs": 6, "side": 1, "drift": np.zeros(2)}
        return Pattern(PARALLEL, np.array(start), heading, **{**usual, **values})

    @pytest.mark.parametrize(
        ("start", "heading", "drift"),
        [
            ((0.0, SHORE + 700), math.pi, (0.0, 0.0)),  # the first leg leads to the sea
            ((0.0, SHORE + 700), math.pi, (0.1, 0.4)),
            ((0.0, SHORE + 400), math.pi / 2, (0.0, 0.0)),  # a later leg does
            ((0.0, SHORE - 20), math.pi, (0.0, 0.0)),  # at sea, but not as it is read
            ((0.0, SHORE - 700), math.pi, (0.0, 0.0)),  # at sea
        ],
    )
    def test_is_moved_along_its_legs_to_the_sea(self, north, start, heading, drift):
        incident = Incident(**STILL, coast=north)
        coast = Coast(incident)
        drone = drone_in_wind(incident, 0)
        given = self.pattern(start, heading, drift=np.array(drift))
        begun = begun_at_sea(given, drone, coast)
        flown = drone.fly(begun)
        assert flown is not None
        scene = flown.points[1, 1:]
        as_read = incident.plane.metres(*(np.round(600 * incident.plane.degrees(scene)) / 600))
        assert not coast.is_land(np.array([scene, as_read]).T).any()
        assert begun.begin % 10 == 0
        # It is the first one of those every 10 m, and all that follows is as before.
        assert (begun.begin == 0) == (start == (0.0, SHORE - 700))
        left = 30 - begun.legs_left_out
        assert begun.points(30)[1:left] == pytest.approx(
            given.points(30)[1 + begun.legs_left_out :]
        )

    def test_a_pattern_over_land_stays(self, north):
        incident = Incident(**STILL, coast=north)
        given = self.pattern((0.0, SHORE + 9000), 0.0)
        begun = begun_at_sea(given, drone_in_wind(incident, 0), Coast(incident))
        assert begun is given


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A plan beside the small island, and across the date line."""
    folder = tmp_path_factory.mktemp("plans")
    usual = {**STILL, "position_error": 900, "night": True}
    beside = Incident(**{**usual, "position": (54.18, 7.85)})
    write(plan(beside), folder / "island")
    across = Incident(**{**usual, "position": (-16.82, 179.99)})
    write(plan(across), folder / "date_line")
    write(plan(Incident(**{**usual, "coast": "none"})), folder / "none")
    return folder


class TestFiles:
    def land_in(self, folder: Path) -> Any:
        """The land in the GeoJSON file of a plan."""
        features = json.loads((folder / "plan.geojson").read_text())["features"]
        [land] = [each for each in features if each["properties"].get("name") == "land"]
        return shapely.geometry.shape(land["geometry"])

    @pytest.mark.thorough
    def test_geojson_holds_the_land(self, folder):
        collection = json.loads((folder / "island" / "plan.geojson").read_text())
        [land] = [
            each for each in collection["features"] if each["properties"].get("name") == "land"
        ]
        shape = shapely.geometry.shape(land["geometry"])
        given = shapely.from_wkb(sys.modules["roaring_landmask"].Shapes.wkb("small"))
        west, south, east, north = shape.bounds
        assert shape.is_valid and 7.8 < west < 7.88 < east < 7.95
        part = shapely.clip_by_rect(given, west, south, east, north)
        assert shape.symmetric_difference(part).area < 1e-3 * part.area

    def test_at_the_date_line_the_land_is_in_two_parts(self, folder):
        collection = json.loads((folder / "date_line" / "plan.geojson").read_text())
        [land] = [
            each for each in collection["features"] if each["properties"].get("name") == "land"
        ]
        shape = shapely.geometry.shape(land["geometry"])
        assert shape.is_valid and shape.bounds[0] == -180 and shape.bounds[2] == 180
        longitudes = np.abs(shapely.get_coordinates(shape)[:, 0])
        assert (longitudes > 179.8).all()

    def test_kml_holds_the_land(self, folder):
        root = ET.parse(folder / "island" / "plan.kml")
        names = [each.text for each in root.iter("{http://www.opengis.net/kml/2.2}name")]
        assert names.count("land") == 1
        rings = list(root.iter("{http://www.opengis.net/kml/2.2}LinearRing"))
        assert rings

    def test_the_map_has_hatched_land(self, folder):
        assert 'id="h' in (folder / "island" / "map.svg").read_text()  # a pattern of hatches
        assert 'id="h' not in (folder / "none" / "map.svg").read_text()

    def test_without_a_coast_the_files_have_no_land(self, folder):
        assert '"land"' not in (folder / "none" / "plan.geojson").read_text()
        assert ">land<" not in (folder / "none" / "plan.kml").read_text()


class TestSearchOnAGrid:
    @pytest.fixture
    def search(self, north) -> NamedSearch:
        return search_on_grid(Incident(**{**STILL, "position_error": 500}, coast=north))

    def test_knows_the_cells_on_land(self, search, north):
        """Exactly those whose centres are."""
        incident = Incident(**{**STILL, "position_error": 500}, coast=north)
        size = search.scenario.grid_size
        cells = np.array([(x, y) for y in range(size) for x in range(size)])
        degrees = locate(incident, cells)
        land = Coast(incident).is_land(incident.plane.metres(*degrees.T).T)
        assert 0 < land.sum() < size**2
        assert {*map(tuple, cells[land].tolist())} == {*search.land}

    def test_files_keep_them(self, tmp_path):
        search = NamedSearch("bay", "A bay.", Scenario(5), land=((0, 0), (1, 2)))
        search.save(tmp_path / "search.json")
        again = named_search(str(tmp_path / "search.json"))
        assert again.land == search.land
        assert again.fingerprint == search.fingerprint
        assert replace(search, land=()).fingerprint == search.fingerprint

    def test_pictures_and_text_show_them(self, search, dummy_display):
        env = DroneSwarmSearch(scenario=search.scenario, render_mode=None)
        env.reset(seed=1, drones_positions=search.drones)
        frame = env.frame()
        shown = replace(frame, land=search.land)
        assert render_text(shown).count("/") > len(search.land) / 4 + 2
        assert "/ land" in render_text(shown) and "/ land" not in render_text(frame)
        painter = Painter(frame.grid_size, Look())
        differs = (painter.pixels(shown) != painter.pixels(frame)).any(axis=-1)
        map_pixels = differs.size * 0.5
        share = len(search.land) / frame.grid_size**2
        assert 0.3 * share < differs.sum() / map_pixels < 2 * share

    @pytest.mark.thorough
    @pytest.mark.parametrize(
        ("land", "error"), [([(0, 99)], ValueError), ([(0.5, 1)], ValueError), (3, TypeError)]
    )
    def test_other_cells_are_refused(self, search, land, error):
        with pytest.raises(error, match=r"^land"):
            replace(search, land=land)


@pytest.mark.thorough
def test_the_command_takes_a_coast(tmp_path, capsys, north):
    known = ["--position", "54.0", "5.0", "--time", "2026-03-01T05:30Z", "--object", "PIW-1"]
    known += ["--wind", "180", "20kn", "--error", "100m", "--drones", "1"]
    out = tmp_path / "plan"
    assert main(["plan", *known, "--coast", "none", "--out", str(out)]) == 0
    assert "No coast is known, so nobody strands" in " ".join(capsys.readouterr().out.split())
    assert main(["plan", *known, "--coast", north, "--out", str(out)]) == 0
    assert "of the persons strand by" in " ".join(capsys.readouterr().out.split())
    data = json.loads((out / "incident.json").read_text())
    assert (out / data["coast"]).resolve() == Path(north).resolve()
    assert Incident.read(out / "incident.json").coast.endswith("north.geojson")
    with pytest.raises(SystemExit):
        main(["plan", *known, "--coast", "missing.json", "--out", str(out)])
    assert "--coast must be 'gshhg', 'none' or a GeoJSON file" in capsys.readouterr().err
