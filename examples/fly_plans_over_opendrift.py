"""Fly plans for random incidents over persons whom OpenDrift simulates.

    pip install "DroneSwarmSearchEnvironment[opendrift]"
    python examples/fly_plans_over_opendrift.py

OpenDrift's Leeway model drifts each incident's objects, to which this script adds the error of the
position and turbulence. Its environment is the same for all objects, so that wind and current have
no error here, neither in the plans. With `--coast`, incidents are near coasts, and objects strand
where OpenDrift's landmask has land; otherwise there is none. With `--manual`, the plan of the
manual's worksheets is flown, too. Legs are cut into pieces no longer than the swath; every object
within half a piece along and half a swath across has been passed once more. Forty incidents take
about a quarter of an hour; `--out` keeps results, so that a run that was stopped goes on.

With `--hypotheses`, each incident has two or three of them: points, passages, areas and flares, at
a time or in a window, of one object class or two, and one to four unlike drones. Objects are drawn
from each hypothesis by this script, and what the plan states of each is compared, too.
"""

from __future__ import annotations

import argparse
import csv
import math
from datetime import datetime, timedelta, timezone
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import compare_with_opendrift as opendrift
import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch import geo, leeway
from DroneSwarmSearch.geo.plane import EQUATOR
from DroneSwarmSearch.incident import Drone, FlightPlan, Hypothesis, Incident, plan

Floats = NDArray[np.float64]

BEGAN = datetime(2026, 3, 1, 5, 30, tzinfo=timezone.utc)

STEP = 60  # seconds between positions


NEAR = 0.05  # degrees of latitude to a coast


@cache
def landmask() -> Any:
    """OpenDrift's own landmask."""
    from roaring_landmask import RoaringLandmask

    return RoaringLandmask.new()


def is_land(latitudes: Floats, longitudes: Floats) -> NDArray[np.bool_]:
    """Whether positions in degrees are on land."""
    east = (longitudes + 180) % 360 - 180
    mask: NDArray[np.bool_] = landmask().contains_many(east.copy(), latitudes.copy())
    return mask


def position_near_coast(rng: np.random.Generator) -> tuple[float, float]:
    """A position at sea, with land about 5 km away in some direction."""
    while True:
        latitudes = rng.uniform(-70, 70, 2_000)
        longitudes = rng.uniform(-180, 180, 2_000)
        at_sea = ~is_land(latitudes, longitudes)
        near = np.zeros(len(at_sea), np.bool_)
        for angle in np.arange(0, 2 * np.pi, np.pi / 4):
            north = latitudes + NEAR * np.cos(angle)
            east = longitudes + NEAR * np.sin(angle) / np.cos(np.radians(latitudes))
            near |= is_land(north, east)
        chosen = np.nonzero(at_sea & near)[0]
        if chosen.size:
            return float(latitudes[chosen[0]]), float(longitudes[chosen[0]])


def random_incident(rng: np.random.Generator, coast: bool) -> Incident:
    """An incident of any class, anywhere between 70° south and 70° north, or near coasts there."""
    speed = rng.uniform(18, 35)
    position = (rng.uniform(-70, 70), rng.uniform(-180, 180))
    if coast:
        position = position_near_coast(rng)
    return Incident(
        position=position,
        time=BEGAN,
        start=BEGAN + timedelta(seconds=math.exp(rng.uniform(math.log(600), math.log(6 * 3600)))),
        object_class=str(rng.choice(list(leeway.CLASSES))),
        wind=geo.wind_from(rng.uniform(0, 360), rng.uniform(2, min(22, 0.65 * speed))),
        current=geo.current_towards(rng.uniform(0, 360), rng.uniform(0, 0.8)),
        wind_error=0,
        current_error=0,
        coast="gshhg" if coast else "none",
        position_error=float(rng.choice([100, 500, 926])),
        drones=int(rng.integers(1, 4)),
        speed=speed,
        swath=rng.uniform(100, 400),
        endurance=rng.uniform(1800, 5400),
        night=True,
    )


def random_hypothesis(rng: np.random.Generator, middle: tuple[float, float]) -> Hypothesis:
    """A point, a passage, an area or a flare within some kilometres of a position."""
    plane = geo.TangentPlane(*middle)

    def position() -> tuple[float, float]:
        latitude, longitude = plane.degrees(rng.normal(0.0, 2000.0, 2)).tolist()
        return latitude, longitude

    begin = BEGAN + timedelta(minutes=rng.uniform(0, 60))
    window = (begin, begin + timedelta(minutes=rng.uniform(20, 90)))
    classes = rng.choice(list(leeway.CLASSES), int(rng.integers(1, 3)), replace=False).tolist()
    values: dict[str, Any] = {
        "time": begin if rng.random() < 0.5 else window,
        "object_class": {name: float(rng.uniform(0.2, 1.0)) for name in classes},
        "weight": float(rng.uniform(0.5, 2.0)),
    }
    kind = rng.choice(["point", "line", "area", "flare"])
    if kind == "point":
        values |= {"position": position(), "position_error": float(rng.uniform(100, 1000))}
    elif kind == "line":
        values |= {"line": [position(), position()], "time": window, "position_error": 300.0}
    elif kind == "area":
        values["area"] = [position() for _ in range(3)]
    else:
        values |= {
            "position": position(),
            "position_error": 50.0,
            "bearing": float(rng.uniform(0, 360)),
            "bearing_error": float(rng.uniform(1, 5)),
            "distance": float(rng.uniform(2000, 6000)),
            "distance_error": float(rng.uniform(200, 1000)),
        }
    return Hypothesis(**values)


def random_case(rng: np.random.Generator) -> Incident:
    """An incident of two or three hypotheses with a fleet."""
    middle = (float(rng.uniform(-60, 60)), float(rng.uniform(-180, 180)))
    hypotheses = [random_hypothesis(rng, middle) for _ in range(int(rng.integers(2, 4)))]
    fleet = [
        Drone(
            name=f"{number}",
            base=middle,
            speed=float(rng.uniform(20, 35)),
            endurance=float(rng.uniform(2400, 5400)),
            swath=float(rng.uniform(100, 400)),
            probability_of_detection=float(rng.uniform(0.6, 1.0)),
        )
        for number in range(int(rng.integers(1, 5)))
    ]
    return Incident(
        hypotheses=hypotheses,
        start=BEGAN + timedelta(minutes=rng.uniform(155, 240)),
        wind=geo.wind_from(rng.uniform(0, 360), rng.uniform(2, 12)),
        current=geo.current_towards(rng.uniform(0, 360), rng.uniform(0, 0.8)),
        wind_error=0,
        current_error=0,
        coast="none",
        fleet=fleet,
        night=True,
    )


def drawn_from(
    incident: Incident, case: Hypothesis, rng: np.random.Generator, n: int
) -> tuple[Floats, Floats]:
    """Where n objects of a hypothesis begin, in metres, (n, 2); and when, in seconds."""
    plane = incident.plane
    first, last = (incident.seconds(time) for time in case.time)
    part = rng.uniform(0.0, 1.0, n)
    times = first + part * (last - first)
    blurred = rng.normal(0.0, case.position_error, (n, 2))
    if case.line is not None:
        begin, end = (plane.metres(*each) for each in case.line)
        return begin + part[:, None] * (end - begin) + blurred, times
    if case.area is not None:
        corners = np.array([plane.metres(*each) for each in case.area])
        return rng.dirichlet([1.0, 1.0, 1.0], n) @ corners + blurred, times
    start = plane.metres(*case.position) + blurred
    if case.bearing is not None:
        bearing = np.radians(rng.normal(case.bearing, case.bearing_error, n))
        distance = rng.normal(case.distance, case.distance_error, n)
        start = start + distance[:, None] * np.stack([np.sin(bearing), np.cos(bearing)], axis=1)
    return start, times


def simulated_case(
    incident: Incident, case: Hypothesis, until: float, options: argparse.Namespace
) -> Floats:
    """OpenDrift's objects of a hypothesis; NaN before they drift: (times, objects, 2)."""
    rng = np.random.default_rng(np.random.randint(2**31))
    parts = []
    for name, weight in case.object_class:
        drift = displacements(incident, name, until, options, round(weight * options.tracks))
        start, begun = drawn_from(incident, case, rng, drift.shape[1])
        after = np.arange(len(drift))[:, None] - np.ceil(begun / STEP).astype(int)
        moved = drift[np.maximum(after, 0), np.arange(drift.shape[1])]
        parts.append(np.where(after[..., None] >= 0, start + moved, np.nan))
    return np.concatenate(parts, axis=1)


def displacements(
    incident: Incident, object_class: str, until: float, options: argparse.Namespace, n: int
) -> Floats:
    """How far objects of a class have drifted after some time, in metres: (times, n, 2)."""
    known = opendrift.Incident(
        object_class,
        incident.wind.vectors_from(0.0)[0.0],
        incident.current.vectors_from(0.0)[0.0],
        position_sd=0.0,
    )
    few = argparse.Namespace(**{**vars(options), "tracks": max(n, 1)})
    tracks = known.tracks(until / 3600 + 0.5, few)
    at = np.arange(0, until + STEP, STEP) / opendrift.TRACK_SECONDS
    before = at.astype(int)
    part = (at - before)[:, None, None]
    positions = (1 - part) * tracks[before] + part * tracks[before + 1]
    walk = np.random.normal(0.0, math.sqrt(2 * leeway.DIFFUSIVITY * STEP), positions.shape)
    moved: Floats = positions + walk.cumsum(axis=0)
    return moved - moved[0]


def simulated(incident: Incident, until: float, options: argparse.Namespace) -> Floats:
    """OpenDrift's objects in metres on the plane of the incident: (times, objects, 2)."""
    known = opendrift.Incident(
        incident.object_class,
        incident.wind.vectors_from(0.0)[0.0],
        incident.current.vectors_from(0.0)[0.0],
        position_sd=0.0,
    )
    tracks = known.tracks(until / 3600 + 0.5, options)
    at = np.arange(0, until + STEP, STEP) / opendrift.TRACK_SECONDS
    before = at.astype(int)
    part = (at - before)[:, None, None]
    positions = (1 - part) * tracks[before] + part * tracks[before + 1]
    walk = np.random.normal(0.0, math.sqrt(2 * leeway.DIFFUSIVITY * STEP), positions.shape)
    start = np.random.normal(0.0, incident.position_error, positions.shape[1:])
    if options.coast:
        start = at_sea_again(incident, start)
    # OpenDrift's objects were at the equator. Elsewhere, north is another direction on the plane.
    turning = math.tan(math.radians(incident.position[0])) / EQUATOR
    found = [start]
    for east, north in np.diff(positions + walk.cumsum(axis=0), axis=0).transpose(0, 2, 1):
        turned = turning * found[-1][:, 0]
        moves = np.stack([east - turned * north, north + turned * east], axis=-1)
        found.append(found[-1] + moves)
    tracks = np.array(found)
    return stranded(incident, tracks) if options.coast else tracks


def on_land(incident: Incident, metres: Floats) -> NDArray[np.bool_]:
    """Whether positions, (n, 2), are on land."""
    latitudes, longitudes = incident.plane.degrees(metres).T
    return is_land(latitudes, longitudes)


def at_sea_again(incident: Incident, start: Floats) -> Floats:
    """Positions in which those on land have been drawn again."""
    wrong = on_land(incident, start)
    while wrong.any():
        start[wrong] = np.random.normal(0.0, incident.position_error, (int(wrong.sum()), 2))
        wrong[wrong] = on_land(incident, start[wrong])
    return start


def stranded(incident: Incident, tracks: Floats) -> Floats:
    """Tracks in which objects stay where they were before they come to land."""
    ashore = np.zeros(tracks.shape[1], np.bool_)
    for row in range(1, len(tracks)):
        ashore |= on_land(incident, tracks[row])
        tracks[row, ashore] = tracks[row - 1, ashore]
    return tracks


def found(flights: FlightPlan, options: argparse.Namespace) -> float:
    """The share of OpenDrift's objects that the flights find."""
    incident = flights.incident
    return found_of(flights, simulated(incident, incident.seconds(flights.landed), options))


def found_of(flights: FlightPlan, tracks: Floats) -> float:
    """The share of objects that the flights find, by their tracks: (times, objects, 2)."""
    incident = flights.incident
    missed = np.ones(tracks.shape[1])
    for flight, drone in zip(flights.flights, incident.craft, strict=True):
        passed = np.zeros(tracks.shape[1])
        places = incident.plane.metres(
            [each.latitude for each in flight], [each.longitude for each in flight]
        )
        seconds = np.array([incident.seconds(each.time) for each in flight])
        for leg, (now, _) in enumerate(pairwise(flight)):
            way = places[leg + 1] - places[leg]
            length = float(np.hypot(*way))
            if not (now.searching and length):
                continue
            unit = way / length
            pieces = math.ceil(length / drone.swath)
            for part in (np.arange(pieces) + 0.5) / pieces:
                time = seconds[leg] + part * (seconds[leg + 1] - seconds[leg])
                away = tracks[round(time / STEP)] - places[leg] - part * way
                along = np.abs(away @ unit)
                across = np.abs(away @ (unit[::-1] * [1, -1]))
                passed += (along <= length / pieces / 2) & (across <= drone.swath / 2)
        missed *= (1 - drone.probability_of_detection) ** passed
    return float(1 - missed.mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--incidents", type=int, default=24, help="how many (24)")
    parser.add_argument("--tracks", type=int, default=20_000, help="objects per incident (20,000)")
    parser.add_argument("--seed", type=int, default=500, help="of the first incident (500)")
    parser.add_argument("--coast", action="store_true", help="incidents near coasts")
    parser.add_argument("--manual", action="store_true", help="fly the manual's plans, too")
    parser.add_argument("--hypotheses", action="store_true", help="incidents with several")
    parser.add_argument("--out", type=Path, help="a CSV file with a row for each incident")
    parser.set_defaults(jibing=0.04)
    options = parser.parse_args()
    rows = read_rows(options.out)
    print(f"{'object class':>23}  latitude  wind  adrift  stated  found  manual")
    for seed in range(options.seed, options.seed + options.incidents):
        if str(seed) not in rows:
            rows[str(seed)] = flown(seed, options)
            write_rows(options.out, rows)
        show(rows[str(seed)])
    summarise([row for row in rows.values() if row["stated"]])


COLUMNS = ("seed", "object_class", "latitude", "wind", "adrift", "stated", "found", "manual")
PARTS = 3  # hypotheses
ALL_COLUMNS = (
    *COLUMNS,
    *(f"{name}{number}" for number in range(1, PARTS + 1) for name in ("stated", "found")),
)


def flown(seed: int, options: argparse.Namespace) -> dict[str, str]:
    """The row of an incident; what a refused plan finds is left out."""
    np.random.seed(seed)  # OpenDrift draws from it
    if options.hypotheses:
        return flown_case(seed, options)
    incident = random_incident(np.random.default_rng(seed), options.coast)
    wind = np.hypot(*incident.wind.vectors_from(0.0)[0.0])
    row = {
        "seed": str(seed),
        "object_class": str(incident.object_class),
        "latitude": f"{incident.position[0]:.1f}",
        "wind": f"{wind:.1f}",
        "adrift": f"{(incident.start - incident.time).total_seconds() / 3600:.1f}",
        **dict.fromkeys(("stated", "found", "manual"), ""),
    }
    try:
        flights = plan(incident)
    except ValueError:
        return row
    row["stated"] = f"{flights.probability_of_success:.4f}"
    row["found"] = f"{found(flights, options):.4f}"
    if options.manual:
        try:
            row["manual"] = f"{found(plan(incident, method='manual'), options):.4f}"
        except ValueError:
            row["manual"] = "0"
    return row


def flown_case(seed: int, options: argparse.Namespace) -> dict[str, str]:
    """The row of an incident with several hypotheses, and what is found of each."""
    incident = random_case(np.random.default_rng(seed))
    row = {
        "seed": str(seed),
        "object_class": f"{len(incident.cases)} hypotheses",
        "latitude": f"{incident.origin.position[0]:.1f}",
        "wind": f"{np.hypot(*incident.wind.vectors_from(0.0)[0.0]):.1f}",
        "adrift": f"{incident.seconds(incident.start) / 3600:.1f}",
        **dict.fromkeys(ALL_COLUMNS[5:], ""),
    }
    try:
        flights = plan(incident)
    except ValueError:
        return row
    until = incident.seconds(flights.landed)
    weights = np.array([case.weight for case in incident.cases])
    shares = []
    for number, (case, part) in enumerate(zip(incident.cases, flights.parts, strict=False), 1):
        tracks = simulated_case(incident, case, until, options)
        shares.append(found_of(flights, tracks))
        row[f"stated{number}"] = f"{part.probability_of_success:.4f}"
        row[f"found{number}"] = f"{shares[-1]:.4f}"
    row["stated"] = f"{flights.probability_of_success:.4f}"
    row["found"] = f"{weights @ shares / weights.sum():.4f}"
    return row


def show(row: dict[str, str]) -> None:
    """Print a row."""
    success = [row[name] and f"{float(row[name]):.1%}" for name in COLUMNS[5:8]]
    stated, share, manual = success
    known = f"{row['latitude']:>7}°  {row['wind']:>4}  {row['adrift']:>4} h"
    print(
        f"{row['object_class']:>23}  {known}  {stated or 'refused':>6}  {share:>5}  {manual:>6}",
        flush=True,
    )


def summarise(rows: list[dict[str, str]]) -> None:
    """Print what is found against what was stated, and what the manual's plans find."""
    stated = np.array([float(row["stated"]) for row in rows])
    share = np.array([float(row["found"]) for row in rows])
    points = 100 * (stated - share)
    print(f"stated - found: mean {points.mean():.1f} points, largest {np.abs(points).max():.1f}")
    parts = [
        100 * (float(row[f"stated{number}"]) - float(row[f"found{number}"]))
        for row in rows
        for number in range(1, PARTS + 1)
        if row.get(f"found{number}")
    ]
    if parts:
        worst = np.abs(parts).max()
        print(
            f"of {len(parts)} hypotheses: mean {np.mean(parts):.1f} points, mean size "
            f"{np.abs(parts).mean():.1f}, largest {worst:.1f}"
        )
    if all(row["manual"] for row in rows):
        manual = np.array([float(row["manual"]) for row in rows])
        better = int((share > manual).sum())
        print(
            f"found: {share.mean():.1%}, by the manual's plans {manual.mean():.1%}; "
            f"better in {better} of {len(rows)}"
        )


def read_rows(path: Path | None) -> dict[str, dict[str, str]]:
    """The rows of a file, by seed."""
    if path is None or not path.exists():
        return {}
    with path.open(newline="", encoding="utf-8") as file:
        return {row["seed"]: row for row in csv.DictReader(file)}


def write_rows(path: Path | None, rows: dict[str, dict[str, str]]) -> None:
    """Write all rows."""
    if path is None:
        return
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, ALL_COLUMNS, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows.values())


if __name__ == "__main__":
    main()
