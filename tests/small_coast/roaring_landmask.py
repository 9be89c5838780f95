"""A small coastline in place of the package of this name, which is 100 MB large.

The islands and shores are only roughly where those of the earth are.
"""

import shapely

ISLAND = [(7.872, 54.188), (7.88, 54.19), (7.893, 54.186), (7.899, 54.178), (7.888, 54.175)]
"""Like Helgoland, one and a half kilometres long, east of the README's last known position."""

DUNE = [(7.91, 54.187), (7.93, 54.188), (7.925, 54.18), (7.912, 54.182)]

MAINLAND = [
    (8.2, 46.0),
    (8.2, 53.7),
    (8.9, 53.9),
    (8.6, 54.4),
    (8.9, 55.5),
    (13.0, 55.5),
    (13.0, 46.0),
]

ACROSS_THE_DATE_LINE = (
    [(179.9, -16.8), (179.9, -16.7), (180.0, -16.7), (180.0, -16.8)],
    [(-180.0, -16.8), (-180.0, -16.7), (-179.95, -16.7), (-179.95, -16.8)],
)

SOUTH = [(-180.0, -90.0), (-180.0, -78.0), (180.0, -78.0), (180.0, -90.0)]


class LandmaskProvider:
    """The coastlines that there are."""

    Gshhg = "small"


class Shapes:
    """The polygons of a coastline."""

    @staticmethod
    def wkb(provider: str) -> bytes:
        assert provider == LandmaskProvider.Gshhg
        outlines = [ISLAND, DUNE, MAINLAND, *ACROSS_THE_DATE_LINE, SOUTH]
        polygons = [shapely.Polygon(outline) for outline in outlines]
        return shapely.to_wkb(shapely.MultiPolygon(polygons))
