"""`incident.units`: quantities, directions and positions as people type them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from DroneSwarmSearch.geo import units

KNOT = 1852 / 3600


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [
        *(
            (text, units.SPEED, 25 * KNOT)
            for text in ("25kn", "25kt", "25 kts", "25KN", "25 Knots")
        ),
        ("12.5 m/s", units.SPEED, 12.5),
        ("36km/h", units.SPEED, 10),
        *((text, units.LENGTH, 926) for text in ("0.5nm", ".5 nmi", "0.5 NM", "926m", "0.926 km")),
        *((text, units.TIME, 1800) for text in ("30min", "30 min", "0.5h", "1800 s", "30 minutes")),
        *((text, units.TIME, 5400) for text in ("1h30", "1h 30min", "1 h 30 min", "90min", "1.5h")),
    ],
)
def test_quantities(text, kind, value):
    assert units.quantity(text, kind) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("text", ["25", "", "kn", "-5kn", "1..2kn", "5 furlongs", "5kn now", "5m"])
def test_other_quantities_are_refused(text):
    with pytest.raises(ValueError, match=r"kn, kt, .*got '"):
        units.quantity(text, units.SPEED)


@pytest.mark.parametrize(
    ("text", "degrees"),
    [("NW", 315), ("wnw", 292.5), ("n", 0), ("SSE", 157.5), ("300", 300), ("300°", 300), ("0", 0)],
)
def test_directions(text, degrees):
    assert units.direction(text) == degrees


@pytest.mark.parametrize("text", ["361", "-10", "NNNW", "", "up", "1e2"])
def test_other_directions_are_refused(text):
    with pytest.raises(ValueError, match=r"degrees from 0 to 360, or N, NNE to NNW, got '"):
        units.direction(text)


@pytest.mark.parametrize(
    "text",
    [
        "54-10.8N 007-51.0E",
        "54-10.8n007-51.0e",
        "54°10.8'N 7°51.0'E",
        "54 10.8 N 7 51 E",
        "N54 10.8 E7 51",
        "N 54 10.8, E 007 51.0",
        "54 10 48 N / 7 51 0 E",
        "54-10-48N 007-51-00E",
        "54\u00b010\u203248\u2033N 7\u00b051\u20320\u2033E",
        "54.18 7.85",
        "54.18, 7.85",
        "54.18N 7.85E",
    ],
)
def test_positions(text):
    assert units.position(text) == pytest.approx((54.18, 7.85), abs=1e-12)
    assert units.radioed(units.position(text)) == "54°10.8'N 007°51.0'E"


@pytest.mark.parametrize(
    "text",
    [
        "54-10.8 7-51.0",  # in which hemisphere?
        "7-51.0E 54-10.8N",
        "54-70.8N 007-51.0E",
        "54.5-10N 007-51.0E",
        "-54-10N 007-51.0E",
        "54-10.8N",
        "54",
        "",
        "here now",
    ],
)
def test_other_positions_are_refused(text):
    with pytest.raises(ValueError, match=r"such as 54.18.*got '"):
        units.position(text)


@given(st.floats(-89, 89), st.floats(-180, 180))
def test_printed_positions_are_read_again(latitude, longitude):
    south, east = units.position(units.radioed((latitude, longitude)))
    assert south == pytest.approx(latitude, abs=0.051 / 60)
    assert (east - longitude + 180) % 360 == pytest.approx(180, abs=0.051 / 60)
