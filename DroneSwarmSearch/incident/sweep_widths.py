"""Sweep widths of helicopters and boats, from the public tables; for drones there are none.

The tables are of visual search by day: that of helicopters at 500 feet in the U.S. National Search
and Rescue Supplement and the Coast Guard's addendum to it (COMDTINST M16130.2F), and that of
merchant vessels in the IAMSAR Manual, volume II, table N-4. The corrections for wind are those of
the U.S. National SAR Manual, volume I, table D-1, and for the speed of a helicopter of table D-2.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from DroneSwarmSearch.geo.units import KNOT
from DroneSwarmSearch.incident.by_class import ByClass

MILE = 1852.0

VISIBILITIES = {"helicopter": (1, 3, 5, 10, 15, 20, 30), "boat": (3, 5, 10, 15, 20)}
"""In nautical miles."""

PERSON = "person"
RAFT_1 = "raft for 1"
RAFT_4 = "raft for 4"
RAFT_6 = "raft for 6"
RAFT_15 = "raft for 15"
RAFT_25 = "raft for 25"
BOAT_15 = "boat of 15 ft"
BOAT_20 = "boat of 20 ft"
BOAT_33 = "boat of 33 ft"
BOAT_78 = "boat of 78 ft"

WIDTHS: dict[str, dict[str, tuple[float, ...]]] = {
    "helicopter": {
        PERSON: (0.0, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1),
        RAFT_1: (0.4, 0.9, 1.2, 1.6, 1.8, 1.8, 1.8),
        RAFT_4: (0.5, 1.2, 1.6, 2.2, 2.6, 2.8, 2.8),
        RAFT_6: (0.5, 1.4, 1.9, 2.7, 3.2, 3.5, 3.5),
        RAFT_15: (0.6, 1.7, 2.3, 3.3, 4.0, 4.4, 5.0),
        RAFT_25: (0.6, 1.9, 2.7, 4.1, 5.0, 5.6, 6.4),
        BOAT_15: (0.5, 1.2, 1.5, 1.9, 2.2, 2.3, 2.3),
        BOAT_20: (0.7, 2.0, 2.9, 4.3, 5.2, 5.8, 5.8),
        BOAT_33: (0.8, 2.5, 3.9, 6.2, 7.8, 9.0, 10.7),
        BOAT_78: (0.8, 3.3, 5.7, 10.8, 15.0, 18.4, 23.9),
    },
    "boat": {
        PERSON: (0.4, 0.5, 0.6, 0.7, 0.7),
        RAFT_1: (2.3, 3.2, 4.2, 4.9, 5.5),
        RAFT_4: (2.3, 3.2, 4.2, 4.9, 5.5),
        RAFT_6: (2.5, 3.6, 5.0, 6.2, 6.9),
        RAFT_15: (2.6, 4.0, 5.1, 6.4, 7.3),
        RAFT_25: (2.7, 4.2, 5.2, 6.5, 7.5),
        BOAT_15: (1.1, 1.4, 1.9, 2.1, 2.3),
        BOAT_20: (2.0, 2.9, 4.3, 5.2, 5.8),
        BOAT_33: (2.8, 4.5, 7.6, 9.4, 11.6),
        BOAT_78: (3.2, 5.6, 10.7, 14.7, 18.1),
    },
}
"""Uncorrected, in nautical miles, for each visibility. The boat of 33 feet is one of 40 feet in the
table of vessels, and their smallest raft is that for 4."""

SMALL = (PERSON, RAFT_1, RAFT_4, RAFT_6, RAFT_15, RAFT_25, BOAT_15, BOAT_20)
"""Objects that waves hide."""

WINDS = (15 * KNOT, 25 * KNOT)
WEATHER = {True: (1.0, 0.5, 0.25), False: (1.0, 0.9, 0.9)}
"""Factors up to 15 knots of wind, to 25 and above, for small objects and for others."""

SPEEDS = (60 * KNOT, 90 * KNOT, 120 * KNOT, 140 * KNOT)
BY_SPEED = {PERSON: (1.5, 1.0, 0.8, 0.7), RAFT_1: (1.3, 1.0, 0.9, 0.8)}
BY_SPEED_OF_OTHERS = (1.2, 1.0, 0.9, 0.8)
"""Factors of helicopters."""

DETECTION = 0.78
"""That a search with a coverage of 1 finds the object, by the inverse cube law (Koopman, 1946): the
strip is as much wider than the sweep width."""

OBJECTS = {
    "PIW": PERSON,
    "LIFE-RAFT-DB-10": RAFT_6,
    "LIFE-RAFT-DB-18": RAFT_15,
    "LIFE-RAFT-DB-21": RAFT_6,
    "LIFE-RAFT": RAFT_4,
    "USCG-RESCUE": RAFT_6,
    "AVIATION": RAFT_4,
    "LIFE-CAPSULE": RAFT_15,
    "PERSON-POWERED-VESSEL": RAFT_1,
    "SKIFF": BOAT_15,
    "SPORT-BOAT": BOAT_20,
    "FISHING-VESSEL": BOAT_33,
    "SAILBOAT": BOAT_33,
    "REFUGEE-RAFT": RAFT_25,
}
"""The object of the tables for each class, by the beginning of its key; the longest counts."""


def sweep_width(
    aircraft: str, object_class: str, *, visibility: float, wind: float, speed: float
) -> float:
    """The sweep width of a helicopter or a boat, in metres, corrected for the weather.

    Args:
        aircraft: "helicopter" or "boat".
        object_class: a key of `leeway.CLASSES`.
        visibility: in metres.
        wind: in m/s.
        speed: of the helicopter, in m/s.

    Raises:
        ValueError: the tables know no such object.
    """
    keys = [key for key in OBJECTS if object_class.startswith(key)]
    if not keys:
        raise ValueError(
            f"swath must be given for {object_class}: the tables of sweep widths do not have it"
        )
    kind = OBJECTS[max(keys, key=len)]
    visible = np.interp(visibility / MILE, VISIBILITIES[aircraft], WIDTHS[aircraft][kind])
    weather = WEATHER[kind in SMALL][int(np.searchsorted(WINDS, wind))]
    by_speed = 1.0
    if aircraft == "helicopter":
        factors = BY_SPEED.get(kind, BY_SPEED_OF_OTHERS)
        by_speed = float(np.interp(speed, SPEEDS, factors))
    return float(visible * weather * by_speed * MILE)


def swaths(
    aircraft: str, classes: Sequence[str], *, visibility: float, wind: float, speed: float
) -> ByClass:
    """The width of the strip in which `DETECTION` of each object are found, for each class."""
    widths = {
        name: sweep_width(aircraft, name, visibility=visibility, wind=wind, speed=speed)
        for name in classes
    }
    return tuple((name, max(width / DETECTION, 1.0)) for name, width in widths.items())
