"""Fly plans for random incidents over persons whom OpenDrift simulates.

    pip install "DroneSwarmSearchEnvironment[opendrift]"
    python examples/fly_plans_over_opendrift.py

OpenDrift's Leeway model drifts each incident's objects, to which this script adds the error of the
position and turbulence. Its environment is the same for all objects, so that wind and current have
no error here, neither in the plans. There is no land. Legs are cut into pieces no longer than the
swath; every object within half a piece along and half a swath across has been passed once more.
The whole run takes some minutes.
"""

from __future__ import annotations

import argparse
import math
from datetime import datetime, timedelta, timezone
from itertools import pairwise

import compare_with_opendrift as opendrift
import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch import geo, leeway
from DroneSwarmSearch.geo.plane import EQUATOR
from DroneSwarmSearch.incident import FlightPlan, Incident, plan

Floats = NDArray[np.float64]

STEP = 60  # seconds between positions


def random_incident(rng: np.random.Generator) -> Incident:
    """An incident of any class, anywhere between 70° south and 70° north."""
    speed = rng.uniform(18, 35)
    time = datetime(2026, 3, 1, 5, 30, tzinfo=timezone.utc)
    return Incident(
        position=(rng.uniform(-70, 70), rng.uniform(-180, 180)),
        time=time,
        start=time + timedelta(seconds=math.exp(rng.uniform(math.log(600), math.log(6 * 3600)))),
        object_class=str(rng.choice(list(leeway.CLASSES))),
        wind=geo.wind_from(rng.uniform(0, 360), rng.uniform(2, min(22, 0.65 * speed))),
        current=geo.current_towards(rng.uniform(0, 360), rng.uniform(0, 0.8)),
        wind_error=0,
        current_error=0,
        coast="none",
        position_sd=float(rng.choice([100, 500, 926])),
        drones=int(rng.integers(1, 4)),
        speed=speed,
        swath=rng.uniform(100, 400),
        endurance=rng.uniform(1800, 5400),
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
    start = np.random.normal(0.0, incident.position_sd, positions.shape[1:])
    # OpenDrift's objects were at the equator. Elsewhere, north is another direction on the plane.
    turning = math.tan(math.radians(incident.position[0])) / EQUATOR
    found = [start]
    for east, north in np.diff(positions + walk.cumsum(axis=0), axis=0).transpose(0, 2, 1):
        turned = turning * found[-1][:, 0]
        moves = np.stack([east - turned * north, north + turned * east], axis=-1)
        found.append(found[-1] + moves)
    return np.array(found)


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
    parser.set_defaults(jibing=0.04)
    options = parser.parse_args()
    np.random.seed(0)  # OpenDrift draws from it
    excess = []
    print(f"{'object class':>23}  latitude  wind  adrift  stated  found")
    for seed in range(options.seed, options.seed + options.incidents):
        incident = random_incident(np.random.default_rng(seed))
        try:
            flights = plan(incident)
        except ValueError as error:
            print(f"{incident.object_class:>23}  refused: {error}")
            continue
        stated = flights.probability_of_success
        share = found(flights, options)
        excess.append(stated - share)
        adrift = (incident.start - incident.time).total_seconds() / 3600
        wind = np.hypot(*incident.wind.vectors_from(0.0)[0.0])
        print(
            f"{incident.object_class:>23}  {incident.position[0]:7.1f}°  "
            f"{wind:4.1f}  {adrift:4.1f} h  {stated:6.1%}  {share:.1%}",
            flush=True,
        )
    points = 100 * np.array(excess)
    print(f"stated - found: mean {points.mean():.1f} points, largest {np.abs(points).max():.1f}")


if __name__ == "__main__":
    main()
