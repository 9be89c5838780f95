"""Write the file of the suite's searches, in which those at sea are converted to cells and steps.

    python docs/make_suite.py

writes `DroneSwarmSearch/evaluation/suite_v2.json`. Each function below is a search; its docstring
is the reason for it, as the leaderboard prints it. The last three are of tracks that
`docs/make_tracks.py` simulated before. Directions are degrees clockwise from north:
winds come from there, currents set towards there.

The searches of a published version never change. To change one, write another version of the file.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

from DroneSwarmSearch import Drift, Person, Scale, detection, leeway, priors
from DroneSwarmSearch.core.grid import Cell
from DroneSwarmSearch.evaluation import suite
from DroneSwarmSearch.geo import KNOT, current_towards, wind_from

FILE = Path(suite.__file__).with_name("suite_v2.json")
VERSION = "v2"

MINUTES = 60
HOURS = 3600

adrift_at_sea = partial(leeway.person, jibing=0)
"""In this version of the suite, objects stay on their side of the wind."""

WIDTH = 96
"""Characters in a line of the file, where it can be divided."""

Entry = dict[str, Any]
SEARCHES: dict[str, Callable[[], Entry]] = {}
"""The searches by name, in the order of the tables."""


def search(make: Callable[[], Entry]) -> Callable[[], Entry]:
    """Enter a function as a search: its name, with hyphens, is the name of the search."""
    SEARCHES[make.__name__.replace("_", "-")] = make
    return make


# Plain searches, in cells and steps.


@search
def pond() -> Entry:
    """A control case: one drone, still water and a short time limit.

    The optimum can be checked by other means, so a policy that fails here is faulty.
    """
    return plain(10, 40, (5, 5), vector=(0, 0), disperse_constant=1, drones=[(0, 0)])


@search
def dsse_2024() -> Entry:
    """The search of DSSE's published baselines (PPO 83.0%, greedy 50.2%).

    Four drones start at the middles of the edges; the person drifts slowly from the centre and
    spreads little. DSSE's persons and drones follow other rules: compare with care.
    """
    return plain(
        40,
        100,
        (20, 20),
        vector=(0.083, 0.08),
        disperse_constant=0.65,
        drones=middles_of_edges(40),
    )


@search
def classic() -> Entry:
    """The same layout, but the person spreads out twice as far.

    Four drones cannot search the whole likely area, so it matters where they begin.
    """
    return plain(
        40, 100, (20, 20), vector=(0.05, 0.05), disperse_constant=4, drones=middles_of_edges(40)
    )


@search
def harbour() -> Entry:
    """The person drifts into a corner between two quays.

    The boundary shapes the matrix, and patterns around a datum must be clipped.
    """
    return plain(20, 100, (1, 18), vector=(-0.2, 0.1), disperse_constant=5, drones=[(0, 0), (1, 0)])


@search
def fog() -> Entry:
    """Three in five searches of the right cell miss.

    Cells deserve a second search, so it is not enough to remember which were searched.
    """
    return plain(
        20,
        100,
        (8, 8),
        vector=(0.04, 0.02),
        disperse_constant=1,
        probability_of_detection=0.4,
        drones=middles_of_edges(20),
    )


# Incidents at sea, in metres and seconds.


@search
def man_overboard() -> Entry:
    """A passenger is missing from a ferry in a wind of 16 knots.

    The position of the fall is known to 400 m and is 25 minutes old when three drones take off
    from the ship, 2.5 km away.
    """
    scale = Scale.for_drone(speed=15, swath=150)
    passenger = adrift_at_sea(
        "PIW-1",
        start=(13, 20),
        position_sd=400,
        wind=wind_from(230, 16 * KNOT),
        current=current_towards(80, 0.6 * KNOT),
        adrift=25 * MINUTES,
        scale=scale,
        probability_of_detection=in_one_crossing(scale, sweep_width=140),
    )
    return at_sea(scale, 36, 30 * MINUTES, [passenger], abreast(3, 14, 2))


@search
def gale() -> Entry:
    """A life raft without ballast drifts for an hour in a wind of 34 knots.

    Rafts drift to the right or to the left of the wind, so the likely area is in two parts, which
    move apart while three aircraft search them.
    """
    scale = Scale.for_drone(speed=20, swath=300)
    raft = adrift_at_sea(
        "LIFE-RAFT-NB-1",
        start=(8, 14),
        position_sd=300,
        wind=wind_from(300, 34 * KNOT),
        adrift=1 * HOURS,
        scale=scale,
        probability_of_detection=in_one_crossing(scale, sweep_width=260),
    )
    return at_sea(scale, 44, 50 * MINUTES, [raft], [(0, 21), (0, 22), (0, 23)])


@search
def channel() -> Entry:
    """A current of one knot carries a kayak and its paddler along a channel.

    Two drones start half an hour later, behind them: they must fly ahead of the current.
    """
    scale = Scale.for_drone(speed=12, swath=120)
    kayak = adrift_at_sea(
        "PERSON-POWERED-VESSEL-1",
        start=(6, 22),
        position_sd=300,
        wind=wind_from(200, 10 * KNOT),
        current=current_towards(100, 1.0 * KNOT),
        adrift=30 * MINUTES,
        scale=scale,
        probability_of_detection=in_one_crossing(scale, sweep_width=100),
    )
    return at_sea(scale, 40, 35 * MINUTES, [kayak], [(0, 21), (0, 22)])


@search
def two_positions() -> Entry:
    """A swamped boat, and two reports of its last position, 4 km apart.

    The more trusted one is precise to 500 m. The other one is precise to 800 m, and nearer: two
    drones must decide which area to search first, and when to leave it.
    """
    scale = Scale.for_drone(speed=20, swath=240)
    reports = [
        adrift_at_sea(
            "SKIFF-3",
            start=start,
            position_sd=position_sd,
            wind=wind_from(250, 14 * KNOT),
            current=current_towards(10, 0.4 * KNOT),
            adrift=1 * HOURS,
            scale=scale,
        )
        for start, position_sd in (((10, 29), 500), ((24, 20), 800))
    ]
    boat = Person(
        [
            replace(drift, weight=trust * drift.weight)
            for report, trust in zip(reports, (0.65, 0.35), strict=True)
            for drift in report.drift.drifts
        ],
        in_one_crossing(scale, sweep_width=220),
    )
    return at_sea(scale, 42, 45 * MINUTES, [boat], abreast(2, 40, 0))


@search
def wreck() -> Entry:
    """A ship sinks; its raft and a person in a life jacket are missing.

    They drift apart from one position, known to 400 m. Three drones must find both, although they
    see the raft far more easily.
    """
    scale = Scale.for_drone(speed=20, swath=200)
    persons = [
        adrift_at_sea(
            object_class,
            start=(9, 17),
            position_sd=400,
            wind=wind_from(270, 15 * KNOT),
            current=current_towards(20, 0.5 * KNOT),
            adrift=30 * MINUTES,
            scale=scale,
            probability_of_detection=in_one_crossing(scale, sweep_width),
        )
        for object_class, sweep_width in (("LIFE-RAFT-DB-10", 300), ("PIW-3", 110))
    ]
    return at_sea(scale, 30, 25 * MINUTES, persons, abreast(3, 0, 29))


@search
def night() -> Entry:
    """A swimmer in the dark: with a sweep width of 30 m in cells of 100 m, most searches miss.

    Three drones have 45 minutes, and must spread their effort over the cells again and again.
    """
    scale = Scale.for_drone(speed=10, swath=100)
    sweep_width = 30
    swimmer = adrift_at_sea(
        "PIW-3",
        start=(14, 14),
        position_sd=250,
        wind=wind_from(270, 10 * KNOT),
        current=current_towards(180, 0.2 * KNOT),
        adrift=30 * MINUTES,
        scale=scale,
        probability_of_detection=in_one_crossing(scale, sweep_width, detection.random_search),
    )
    return at_sea(scale, 32, 45 * MINUTES, [swimmer], [(0, 6), (0, 16), (0, 26)])


@search
def overdue() -> Entry:
    """A fishing boat without power is six hours overdue.

    Its last position is known to 1.5 km, and six hours of leeway to either side of a light wind
    have made two wide areas of it. Four aircraft search for an hour.
    """
    scale = Scale.for_drone(speed=25, swath=400)
    boat = adrift_at_sea(
        "FISHING-VESSEL-6",
        start=(9, 21),
        position_sd=1500,
        wind=wind_from(270, 12 * KNOT),
        current=current_towards(180, 0.1 * KNOT),
        adrift=6 * HOURS,
        scale=scale,
        probability_of_detection=in_one_crossing(scale, sweep_width=400),
    )
    return at_sea(scale, 48, 60 * MINUTES, [boat], [(46, 0), (47, 0), (46, 1), (47, 1)])


@search
def fleet() -> Entry:
    """A survivor is somewhere in an area of 40 km², with equal probability.

    Sixteen drones have half an hour in a calm: they must divide the area without conflicts, and
    the policy must scale.
    """
    scale = Scale.for_drone(speed=20, swath=200)
    area = priors.polygon(60, [(12, 20), (40, 8), (50, 24), (42, 44), (20, 48)])
    survivor = Person(
        Drift(
            area,
            vector=scale.vector(current_towards(120, 0.3 * KNOT)),
            diffusion=scale.diffusion(5),
        ),
        in_one_crossing(scale, sweep_width=180),
    )
    return at_sea(scale, 60, 30 * MINUTES, [survivor], abreast(16, 22, 59))


# Incidents at sea where wind or current change, from the tracks of docs/make_tracks.py.


@search
def tide() -> Entry:
    """The tide turns during the search for a skiff, and the wind veers by 90 degrees.

    The skiff drifts out and comes back, to the left or to the right of the wind. Plans for a
    constant drift forecast 72% and find 48%.
    """
    return from_tracks("tide", sweep_width=220, drones=abreast(3, 0, 28))


@search
def eddy() -> Entry:
    """A person in the water circles in an eddy 4 km wide, in a current of 0.8 m/s.

    The likely area winds into a spiral. Plans for a constant drift forecast 67% and find 18%.
    """
    return from_tracks("eddy", sweep_width=150, drones=abreast(4, 5, 0))


@search
def coast() -> Entry:
    """A wind of 12 m/s drives a skiff towards a headland, where it strands.

    Much of the likely area becomes a line of cells along the shore; the rest passes the headland.
    Three drones start from the beach. Plans for a constant drift forecast 69% and find 63%.
    """
    return from_tracks("coast", sweep_width=220, drones=[(29, 23), (29, 24), (29, 25)])


# Parts of a search.


def plain(
    grid_size: int, timestep_limit: int, start: Cell, *, drones: Sequence[Cell], **others: Any
) -> Entry:
    """A search with the environment's own parameters."""
    return {
        "grid_size": grid_size,
        "timestep_limit": timestep_limit,
        "person_initial_position": [start],
        **others,
        "drones_positions": drones,
    }


def at_sea(
    scale: Scale, grid_size: int, seconds: float, persons: list[Person], drones: Sequence[Cell]
) -> Entry:
    """A search in metres and seconds."""
    return {
        "scale": asdict(scale),
        "grid_size": grid_size,
        "timestep_limit": scale.whole_steps(seconds),
        "persons": [
            {
                "probability_of_detection": person.probability_of_detection,
                "drifts": [shortened(drift) for drift in person.drift.drifts],
            }
            for person in persons
        ],
        "drones_positions": drones,
    }


def from_tracks(name: str, sweep_width: float, drones: Sequence[Cell]) -> Entry:
    """A search for a person who drifts as the tracks in a file do."""
    scale = Scale(metres_per_cell=250, seconds_per_step=90)
    file = FILE.with_name(f"{name}.npz")
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    person = {
        "probability_of_detection": in_one_crossing(scale, sweep_width),
        "tracks": {"file": file.name, "sha256": digest},
    }
    return {**at_sea(scale, 41, 3.5 * HOURS, [], drones), "persons": [person]}


def in_one_crossing(
    scale: Scale,
    sweep_width: float,
    function: Callable[[float], float] = detection.inverse_cube,
) -> float:
    """The probability of detection in a cell that a drone crosses once."""
    cell = scale.metres_per_cell
    seconds = scale.seconds_per_step
    coverage = detection.coverage(sweep_width, cell / seconds, seconds, cell**2)
    return round(function(coverage), 2)


def middles_of_edges(grid_size: int) -> list[Cell]:
    """The middles of the upper, right, lower and left edge."""
    half = grid_size // 2
    last = grid_size - 1
    return [(half, 0), (last, half), (half, last), (0, half)]


def abreast(count: int, x: int, y: int) -> list[Cell]:
    """Cells side by side, from (x, y) to the right."""
    return [(x + drone, y) for drone in range(count)]


# The file.


def shortened(drift: Drift) -> Entry:
    """A drift as plain data, without defaults; the largest value of a prior is 1."""
    data = drift.to_dict()
    default = Drift((0, 0)).to_dict()
    if drift.prior is not None:
        data["start"] = (drift.prior / drift.prior.max()).round(2).tolist()
    return {
        name: value for name, value in data.items() if name == "start" or value != default[name]
    }


def rounded(value: Any) -> Any:
    """The same data with six digits, and with whole numbers as integers."""
    if isinstance(value, dict):
        return {name: rounded(each) for name, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [rounded(each) for each in value]
    if isinstance(value, float):
        number = float(f"{value:.6g}")
        return int(number) if number.is_integer() else number
    return value


def as_json(value: Any, indent: str = "") -> str:
    """Data as JSON, in which what fits stays on one line, and so do lists of numbers."""
    line = json.dumps(value)
    several = [*value.values()] if isinstance(value, dict) else value
    if len(indent + line) <= WIDTH or not any(isinstance(each, (dict, list)) for each in several):
        return line
    inner = indent + "  "
    opened, closed = "[]"
    parts = [as_json(each, inner) for each in several]
    if isinstance(value, dict):
        opened, closed = "{}"
        parts = [f"{json.dumps(name)}: {part}" for name, part in zip(value, parts, strict=True)]
    return f"{opened}\n{inner}" + f",\n{inner}".join(parts) + f"\n{indent}{closed}"


def text() -> str:
    """The content of the file."""
    entries = [
        {"name": name, "reason": " ".join(str(make.__doc__).split()), **make()}
        for name, make in SEARCHES.items()
    ]
    return as_json(rounded({"version": VERSION, "searches": entries})) + "\n"


if __name__ == "__main__":
    FILE.write_text(text(), encoding="utf-8", newline="\n")
