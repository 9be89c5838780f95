"""Shortest ways around areas, and boats that keep off the land."""

import heapq
import math
from pathlib import Path

import numpy as np
import pytest

from DroneSwarmSearch.incident import Drone, Incident, plan
from DroneSwarmSearch.incident.flights import track
from DroneSwarmSearch.incident.ways import Ways

pytest.importorskip("cmaes")
shapely = pytest.importorskip("shapely")

SQUARE = shapely.box(0, 0, 1000, 1000)
HOOK = shapely.Polygon(
    [(0, 0), (3000, 0), (3000, 3000), (0, 3000), (0, 2000), (2000, 2000), (2000, 1000), (0, 1000)]
)
TWO = shapely.MultiPolygon([shapely.box(0, -2000, 500, 900), shapely.box(1500, -500, 2000, 3000)])
LAKE = shapely.Polygon(
    [(-4000, -4000), (4000, -4000), (4000, 4000), (-4000, 4000)],
    [[(-500, -500), (-500, 500), (500, 500), (500, -500)]],
)


def on_lattice(area, begin, end, side):
    """Dijkstra's shortest way over a lattice with 16 directions, which is hardly longer."""
    steps = [(1, 0), (1, 1), (2, 1), (1, 2), (0, 1)]
    steps = {(a * x, b * y) for x, y in steps for a in (1, -1) for b in (1, -1)}
    start = tuple(round(each / side) for each in begin)
    goal = tuple(round(each / side) for each in end)
    shapely.prepare(area)
    seen = {}
    queue = [(0.0, start)]
    while queue:
        length, node = heapq.heappop(queue)
        if node in seen:
            continue
        seen[node] = length
        if node == goal:
            return length
        for dx, dy in steps:
            other = (node[0] + dx, node[1] + dy)
            if other in seen or max(map(abs, other)) * side > 6000:
                continue
            line = shapely.LineString(np.multiply([node, other], side))
            if not area.intersects(line):
                heapq.heappush(queue, (length + side * math.hypot(dx, dy), other))
    return math.inf


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("area", "begin", "end"),
    [
        (SQUARE, (-1000, 400), (2000, 600)),
        (SQUARE, (-1000, 400), (-1000, 2000)),
        (HOOK, (1000, 1500), (4000, 1500)),
        (HOOK, (1000, 1500), (-1000, 1500)),
        (TWO, (-1000, 0), (3000, 0)),
    ],
)
def test_ways_are_the_shortest(area, begin, end):
    begin = np.array(begin, np.float64)
    end = np.array(end, np.float64)
    corners = Ways(area).around(begin, end)
    way = np.vstack([begin, corners, end])
    assert not area.intersects(shapely.LineString(way))
    length = np.hypot(*np.diff(way, axis=0).T).sum()
    assert 0.96 < length / on_lattice(area, begin, end, 100.0) < 1.03


def test_there_may_be_no_way():
    assert Ways(LAKE).around(np.zeros(2), np.array([5000.0, 0.0])) is None
    assert len(Ways(LAKE).around(np.zeros(2), np.array([300.0, 0.0]))) == 0


def island(tmp_path, outlines):
    """A coast of polygons, in minutes north and east of 54° N 7° E."""
    path = tmp_path / "coast.geojson"
    degrees = [
        [[[7 + east / 60, 54 + north / 60] for east, north in [*outline, outline[0]]]]
        for outline in outlines
    ]
    path.write_text(
        shapely.to_geojson(shapely.MultiPolygon([(o, []) for (o,) in degrees])), "utf-8"
    )
    return str(path)


def planned(coast, base, **more):
    incident = Incident(
        position=(54, 7),
        time="2026-03-01T09:30Z",
        object_class="LIFE-RAFT-SB-6",
        wind="300 10kn",
        coast=coast,
        fleet=[Drone(name="Anna", aircraft="boat", base=base, endurance="2h")],
        **more,
    )
    return incident, plan(incident, seconds=1)


@pytest.mark.thorough
def test_boats_keep_off_the_land(tmp_path):
    """A long island lies between the harbour, on its own small one, and the search."""
    long = [(-6, -3), (6, -3), (6, -2.5), (-6, -2.5)]
    harbour = [(-1, -6.2), (1, -6.2), (1, -5.8), (-1, -5.8)]
    coast = island(tmp_path, [long, harbour])
    base = (54 - 6 / 60, 7.0)
    incident, made = planned(coast, base)
    land = shapely.union_all(
        [shapely.Polygon(incident.plane.metres(*each.T[::-1])) for each in outlines_of(coast)]
    )
    flown = track(made.flights[0], incident.plane)
    at_sea = shapely.LineString(flown[1:-1])
    assert land.distance(at_sea) > 90
    to_sea = shapely.LineString(flown[:2]).intersection(land)
    assert 0 < to_sea.length < 800, "it leaves its harbour by the shortest way"
    assert made.searches[0].start >= 3, "out of the harbour, and around the island"
    assert made.probability_of_success > 0.3


def outlines_of(coast):
    shape = shapely.from_geojson(Path(coast).read_text("utf-8"))
    return [shapely.get_coordinates(each) for each in shape.geoms]


def test_a_base_far_inland_is_refused(tmp_path):
    coast = island(tmp_path, [[(3, -20), (40, -20), (40, 20), (3, 20)]])
    with pytest.raises(
        ValueError, match="base of a boat must be at most 5 km from the sea, got one"
    ):
        planned(coast, (54, 7.4))


@pytest.mark.thorough
def test_a_boat_on_a_closed_lake_cannot_come_to_the_sea(tmp_path):
    ring = [(-12, -12), (-2.5, -12), (-2.5, 12), (-12, 12)]
    lake = [(-8, -4), (-4, -4), (-4, 4), (-8, 4)]
    path = tmp_path / "coast.geojson"
    degrees = [[(7 + x / 60, 54 + y / 60) for x, y in each] for each in (ring, lake)]
    path.write_text(shapely.to_geojson(shapely.Polygon(degrees[0], [degrees[1]])), "utf-8")
    with pytest.raises(ValueError, match="base of Anna must have a way over the sea to the area"):
        planned(str(path), (54, 7 - 6 / 60))
