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
from DroneSwarmSearch.incident import FlightPlan, Incident, plan

Floats = NDArray[np.float64]

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
    time = datetime(2026, 3, 1, 5, 30, tzinfo=timezone.utc)
    position = (rng.uniform(-70, 70), rng.uniform(-180, 180))
    if coast:
        position = position_near_coast(rng)
    return Incident(
        position=position,
        time=time,
        start=time + timedelta(seconds=math.exp(rng.uniform(math.log(600), math.log(6 * 3600)))),
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
    tracks = simulated(incident, incident.seconds(flights.landed), options)
    passed = np.zeros(tracks.shape[1])
    for flight in flights.flights:
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
            pieces = math.ceil(length / incident.swath)
            for part in (np.arange(pieces) + 0.5) / pieces:
                time = seconds[leg] + part * (seconds[leg + 1] - seconds[leg])
                away = tracks[round(time / STEP)] - places[leg] - part * way
                along = np.abs(away @ unit)
                across = np.abs(away @ (unit[::-1] * [1, -1]))
                passed += (along <= length / pieces / 2) & (across <= incident.swath / 2)
    return float(np.mean(1 - (1 - incident.probability_of_detection) ** passed))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--incidents", type=int, default=24, help="how many (24)")
    parser.add_argument("--tracks", type=int, default=20_000, help="objects per incident (20,000)")
    parser.add_argument("--seed", type=int, default=500, help="of the first incident (500)")
    parser.add_argument("--coast", action="store_true", help="incidents near coasts")
    parser.add_argument("--manual", action="store_true", help="fly the manual's plans, too")
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


def flown(seed: int, options: argparse.Namespace) -> dict[str, str]:
    """The row of an incident; what a refused plan finds is left out."""
    incident = random_incident(np.random.default_rng(seed), options.coast)
    np.random.seed(seed)  # OpenDrift draws from it
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


def show(row: dict[str, str]) -> None:
    """Print a row."""
    success = [row[name] and f"{float(row[name]):.1%}" for name in COLUMNS[5:]]
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
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows.values())


if __name__ == "__main__":
    main()
