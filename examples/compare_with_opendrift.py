"""Compare the map, and a plan made on it, with tracks of the drift model that rescuers use.

    pip install "DroneSwarmSearchEnvironment[opendrift]"
    python examples/compare_with_opendrift.py

The tracks are those of OpenDrift's Leeway model. The first table compares the probability matrix
with the cells of the objects: the total variation distance, that of as many draws from the matrix
(the sampling floor), how far the means are apart, and how much larger OpenDrift's standard
deviations are. The second table compares the forecast probability of success of a plan with the
share of the objects that it finds, for four incidents or, with `--random`, for as many random ones.
The full run takes a quarter of an hour, `--fast` half a minute.

With `--coast`, the objects drift in an eddy off a coast, where many strand. Plans for a constant
drift, and for the tracks of one run of OpenDrift, search for the objects of another run.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from opendrift.models.leeway import Leeway
from opendrift.readers.basereader.continuous import ContinuousReader

from DroneSwarmSearch import (
    Action,
    DroneSwarmSearch,
    Person,
    Scale,
    Scenario,
    Tracks,
    leeway,
    policies,
)
from DroneSwarmSearch.evaluation import share_found

Floats = NDArray[np.float64]
Pair = tuple[float, float]

CLASSES = (
    "LIFE-RAFT-NB-2",
    "PIW-4",
    "PIW-1",
    "PIW-2",
    "PIW-3",
    "PIW-6",
    "PERSON-POWERED-VESSEL-2",
    "SKIFF-4",
    "FISHING-VESSEL-1",
)
WINDS = ((0.0, 10.0), (-6.0, 4.0))  # the second is oblique to the grid
HOURS = (1, 3, 6)
# cells along each side, seconds per step
MAP_SIZE = 101
MAP_SECONDS = 60

# an hour
SEARCH_SIZE = 61
SEARCH_SCALE = Scale(130, 13)
SEARCH_STEPS = 277
DRONES = [(25, 25), (35, 25), (25, 35), (35, 35)]
DETECTION = 0.8

COLUMNS = ("quantity", "object_class", "wind_east", "wind_north", "hours", "map", "opendrift")
"""Of the file: "spread", the root of the variance along x and y in metres; "distance", the total
variation of draws and of OpenDrift's objects from the map; "success", forecast and found."""

TRACK_SECONDS = 600  # OpenDrift's time step
METRES_PER_DEGREE = (111_319.5, 110_574.4)  # at 0° N 0° E, WGS 84


class Incident(NamedTuple):
    """What is known of an object; fields and units as in `leeway.person`."""

    object_class: str
    wind: Pair
    current: Pair = (0.0, 0.0)
    position_sd: float = 250.0
    diffusivity: float = 10.0
    adrift: float = 0.0

    def tracks(self, hours: float, options: argparse.Namespace) -> Floats:
        """OpenDrift's tracks in metres (east, north), every ten minutes: (times, tracks, 2)."""
        model = Leeway(loglevel=50)
        sea = dict(zip(("x_wind", "y_wind"), self.wind, strict=True))
        sea |= zip(("x_sea_water_velocity", "y_sea_water_velocity"), self.current, strict=True)
        for name, value in {**sea, "land_binary_mask": 0}.items():
            model.set_config(f"environment:constant:{name}", value)
        numbers = {row["OBJKEY"]: number for number, row in model.leewayprop.items()}
        place = {"lon": 0.0, "lat": 0.0, "radius": self.position_sd, "time": datetime(2026, 1, 1)}
        objects = {"number": options.tracks, "jibe_probability": options.jibing}
        model.seed_elements(**place, **objects, object_type=numbers[self.object_class])
        steps = {"time_step": TRACK_SECONDS, "time_step_output": TRACK_SECONDS}
        model.run(duration=timedelta(hours=hours), **steps, export_variables=["lon", "lat"])
        degrees = np.stack([model.result.lon.values.T, model.result.lat.values.T], axis=-1)
        by_current = TRACK_SECONDS * np.arange(len(degrees))[:, None, None] * self.current
        by_wind = degrees * METRES_PER_DEGREE - by_current
        # OpenDrift sends "right" objects to the left of the wind: mirror them across the wind.
        downwind = np.array(self.wind) / np.hypot(*self.wind)
        mirrored: Floats = 2 * (by_wind @ downwind)[..., None] * downwind - by_wind
        return mirrored + by_current

    def diffused(self, positions: Floats, seconds: float) -> Floats:
        """Positions after turbulent diffusion, which OpenDrift's Leeway model does not have."""
        deviation = np.sqrt(2 * self.diffusivity * seconds)
        return positions + np.random.normal(0.0, deviation, positions.shape)


INCIDENTS = (
    Incident("PIW-1", (0.0, 10.0), adrift=7200.0),
    Incident("PIW-3", (-5.0, 6.0), (0.15, -0.1), 500.0, diffusivity=3.0, adrift=3600.0),
    Incident("LIFE-RAFT-NB-1", (6.0, -3.0), (-0.1, 0.2), diffusivity=5.0, adrift=3600.0),
    Incident("SKIFF-3", (-4.0, -7.0), (0.1, 0.1), diffusivity=5.0, adrift=7200.0),
)


def random_incidents(count: int, seed: int = 0) -> list[Incident]:
    """Incidents of all classes: winds of 2 to 15 m/s, adrift for up to three hours."""
    generator = np.random.default_rng(seed)

    def vector(low: float, high: float) -> Pair:
        speed = generator.uniform(low, high)
        angle = generator.uniform(0, 2 * np.pi)
        return float(speed * np.cos(angle)), float(speed * np.sin(angle))

    return [
        Incident(
            str(generator.choice(list(leeway.CLASSES))),
            wind=vector(2, 15),
            current=vector(0, 0.4),
            position_sd=float(generator.uniform(100, 500)),
            diffusivity=float(generator.uniform(1, 10)),
            adrift=float(generator.uniform(0, 3 * 3600)),
        )
        for _ in range(count)
    ]


class Snapshot(NamedTuple):
    """The map after some hours, and the shares of OpenDrift's objects in its cells."""

    hours: int
    cell: float  # its side in metres
    matrix: Floats
    shares: Floats


def cells_of(positions: Floats, start: Floats, cell: float) -> NDArray[np.int64]:
    """The cells (x, y) of positions in metres (east, north) from the start cell."""
    return np.floor(start + positions * (1, -1) / cell + 0.5).astype(np.int64)


def snapshots(incident: Incident, options: argparse.Namespace) -> list[Snapshot]:
    """The map and OpenDrift's objects after each of `HOURS`, on a grid that just holds all."""
    tracks = incident.tracks(HOURS[-1], options)
    seconds = [3600 * hours for hours in HOURS]
    positions = [incident.diffused(tracks[each // TRACK_SECONDS], each) for each in seconds]
    corners = np.array([(each.min(axis=0), each.max(axis=0)) for each in (tracks[0], *positions)])
    low = corners.min(axis=(0, 1))
    high = corners.max(axis=(0, 1))
    cell = float((high - low).max()) / (MAP_SIZE - 1)
    start = (MAP_SIZE - 1) / 2 - (low + high) / 2 * (1, -1) / cell
    known = {**incident._asdict(), "start": start, "scale": Scale(cell, MAP_SECONDS)}
    known["jibing"] = options.jibing
    (forecast,) = Scenario(MAP_SIZE, persons=[leeway.person(**known)]).forecasts()
    found = []
    for hours, each in zip(HOURS, positions, strict=True):
        x, y = cells_of(each, start, cell).T
        shares = np.bincount(MAP_SIZE * y + x, minlength=MAP_SIZE**2) / len(each)
        matrix = forecast.exact(3600 * hours // MAP_SECONDS)
        found.append(Snapshot(hours, cell, matrix, shares.reshape(matrix.shape)))
    return found


def search(incident: Incident, options: argparse.Namespace) -> Pair | None:
    """The forecast probability of success of a plan on the map, and the share that it finds.

    None if the map does not fit on the grid.
    """
    tracks = incident.tracks(incident.adrift / 3600 + 1.5, options)
    seconds = incident.adrift
    # In the middle of the search, the objects are around the middle of the grid.
    drifted = tracks[round((seconds + 1800) / TRACK_SECONDS)].mean(axis=0)
    start = (SEARCH_SIZE - 1) / 2 - drifted * (1, -1) / SEARCH_SCALE.metres_per_cell
    known = {**incident._asdict(), "start": start, "scale": SEARCH_SCALE, "jibing": options.jibing}
    person = leeway.person(**known, probability_of_detection=DETECTION)
    if max(person.drift.mass_beyond(SEARCH_SIZE, step) for step in (0, SEARCH_STEPS)) > 0.01:
        return None
    env = DroneSwarmSearch(
        SEARCH_SIZE,
        persons=[person],
        n_drones=len(DRONES),
        timestep_limit=SEARCH_STEPS,
        mission="coverage",  # nobody is found, so the plan runs to its end
        bayesian_update=True,
    )
    policy = policies.make(options.policy, env.scenario)
    observations, infos = env.reset(seed=0, drones_positions=DRONES)
    policy.reset()
    stray = incident.diffused(np.zeros_like(tracks[0]), seconds)
    missed = np.ones(len(stray))
    while env.agents:
        before, part = divmod(seconds / TRACK_SECONDS, 1)
        drifted = (1 - part) * tracks[int(before)] + part * tracks[int(before) + 1]
        x, y = cells_of(drifted + stray, start, SEARCH_SCALE.metres_per_cell).T
        actions = policy(observations)
        for drone, action in actions.items():
            if action == Action.SEARCH:
                column, row = observations[drone]["observation"][0]
                missed[(x == column) & (y == row)] *= 1 - DETECTION
        observations, _, _, _, infos = env.step(actions)
        stray = incident.diffused(stray, SEARCH_SCALE.seconds_per_step)
        seconds += SEARCH_SCALE.seconds_per_step
    return infos["probability_of_success"], 1 - float(missed.mean())


def moments(matrix: Floats) -> tuple[Floats, Floats]:
    """Mean and standard deviation in cells, along x and y."""
    axes = np.stack([matrix.sum(axis=0), matrix.sum(axis=1)])
    cells = np.arange(len(matrix))
    mean = axes @ cells
    return mean, np.sqrt(axes @ cells**2 - mean**2)


def print_row(
    name: str, wind: Pair, snapshot: Snapshot, options: argparse.Namespace
) -> list[tuple[object, ...]]:
    """Print what a map has in common with the tracks, and return rows with `COLUMNS`."""
    hours, cell, matrix, shares = snapshot
    draws = np.random.multinomial(options.tracks, matrix.ravel() / matrix.sum())
    floor = np.abs(draws.reshape(matrix.shape) / options.tracks - matrix).sum() / 2
    mean, sd = moments(matrix)
    other_mean, other_sd = moments(shares)
    apart = cell * np.hypot(*(other_mean - mean))
    x, y = other_sd / sd - 1
    distance = np.abs(shares - matrix).sum() / 2
    print(
        f"{name:>23}  {wind!s:<12}  {hours} h  {distance:8.3f}  "
        f"{floor:.3f}  {apart:3.0f} m  {x:+.1%} {y:+.1%}",
        flush=True,
    )
    spread, other_spread = (cell * np.hypot(*each) for each in (sd, other_sd))
    return [
        ("spread", name, *wind, hours, f"{spread:.0f}", f"{other_spread:.0f}"),
        ("distance", name, *wind, hours, f"{floor:.4f}", f"{distance:.4f}"),
    ]


# An eddy off a coast.

COAST_COLUMNS = ("person", "policy", "forecast", "found")

PLACE = (60.25, 4.87)  # the last known position in degrees, off the islands west of Bergen
# degrees, m, m/s; fastest at the radius
EDDY = (4.89, 60.235)
EDDY_RADIUS = 4000
EDDY_SPEED = 0.4
ADRIFT = Incident("SKIFF-3", (7.0, -1.0), position_sd=700, diffusivity=5, adrift=3600)
# three hours
COAST_SCALE = Scale(250, 25)
COAST_STEPS = 432
COAST_CELL = (22, 26)
COAST_DRONES = [(25, 25), (35, 35)]


def current(longitude: Any, latitude: Any) -> tuple[Any, Any]:
    """The velocity of the water, (east, north), in m/s."""
    east = (longitude - EDDY[0]) * METRES_PER_DEGREE[0] * np.cos(np.radians(EDDY[1])) / EDDY_RADIUS
    north = (latitude - EDDY[1]) * METRES_PER_DEGREE[1] / EDDY_RADIUS
    speed = EDDY_SPEED * np.exp((1 - east**2 - north**2) / 2)
    return speed * north, -speed * east


class Eddy(ContinuousReader):
    """The current, as OpenDrift asks for it."""

    name = "eddy"
    proj4 = "+proj=latlong +datum=WGS84"
    xmin = -180
    xmax = 180
    ymin = -90
    ymax = 90
    start_time = end_time = time_step = None

    def __init__(self) -> None:
        self.variables = ["x_sea_water_velocity", "y_sea_water_velocity"]
        super().__init__()

    def get_variables(self, requested: Any, time: Any, x: Any, y: Any, z: Any) -> dict[str, Any]:
        east, north = current(x, y)
        velocity = {"x_sea_water_velocity": east, "y_sea_water_velocity": north}
        return {"time": time, "x": x, "y": y, "z": z, **velocity}


def tracks_at_the_coast(path: Path, seed: int, options: argparse.Namespace) -> Tracks:
    """The tracks that a run of OpenDrift writes to a file, from the start of the search."""
    model = Leeway(loglevel=50, seed=seed)
    released = datetime(2026, 1, 1)
    model.add_reader(Eddy())
    for name, value in zip(("x_wind", "y_wind"), ADRIFT.wind, strict=True):
        model.set_config(f"environment:constant:{name}", value)
    # Turbulence: another velocity in each time step adds the variance 2 K t.
    turbulence = float(np.sqrt(2 * ADRIFT.diffusivity / TRACK_SECONDS))
    model.set_config("drift:current_uncertainty", turbulence)
    numbers = {row["OBJKEY"]: number for number, row in model.leewayprop.items()}
    place = {"lat": PLACE[0], "lon": PLACE[1], "radius": ADRIFT.position_sd, "time": released}
    objects = {"number": options.tracks, "jibe_probability": options.jibing}
    model.seed_elements(**place, **objects, object_type=numbers[ADRIFT.object_class])
    duration = timedelta(seconds=ADRIFT.adrift + COAST_SCALE.seconds(COAST_STEPS))
    steps = {"time_step": TRACK_SECONDS, "time_step_output": TRACK_SECONDS}
    model.run(duration=duration, **steps, outfile=str(path), export_variables=["lon", "lat"])
    return Tracks.read(
        path,
        scale=COAST_SCALE,
        origin=PLACE,
        cell=COAST_CELL,
        start=released.replace(tzinfo=timezone.utc) + timedelta(seconds=ADRIFT.adrift),
    )


def search_at_the_coast(options: argparse.Namespace) -> list[tuple[object, ...]]:
    """Print what plans forecast and find, and return rows with `COAST_COLUMNS`."""
    with tempfile.TemporaryDirectory() as folder:
        fitted, others = (
            tracks_at_the_coast(Path(folder) / f"{seed}.nc", seed, options) for seed in (0, 1)
        )
    print(fitted)
    known = {**ADRIFT._asdict(), "start": COAST_CELL, "scale": COAST_SCALE}
    known |= {"current": current(*PLACE[::-1]), "jibing": options.jibing}
    persons = {
        "leeway.person": leeway.person(**known, probability_of_detection=DETECTION),
        "Person(tracks)": Person(fitted, DETECTION),
    }
    policies = ["greedy-posterior"] if options.fast else ["greedy-posterior", "planner"]
    rows = []
    print(f"{'person':>14}  {'policy':<16}  forecast  found")
    for name, person in persons.items():
        limits = {"timestep_limit": COAST_STEPS, "mission": "coverage", "bayesian_update": True}
        scenario = Scenario(SEARCH_SIZE, len(COAST_DRONES), persons=person, **limits)
        for policy in policies:
            forecast, plan = plan_of(policy, scenario)
            found = share_found(others, plan, scenario, drones_positions=COAST_DRONES)
            print(f"{name:>14}  {policy:<16}  {forecast:8.1%}  {found:.1%}", flush=True)
            rows.append((name, policy, f"{forecast:.4f}", f"{found:.4f}"))
    return rows


def plan_of(name: str, scenario: Scenario) -> tuple[float, NDArray[np.int64]]:
    """The forecast probability of success of a policy's plan, and the plan: (steps, drones)."""
    env = DroneSwarmSearch(scenario=scenario)
    policy = policies.make(name, scenario)
    observations, infos = env.reset(seed=0, drones_positions=COAST_DRONES)
    policy.reset()
    plan = []
    while env.agents:
        actions = policy(observations)
        plan.append(list(actions.values()))
        observations, _, _, _, infos = env.step(actions)
    return infos["probability_of_success"], np.array(plan)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tracks", type=int, default=200_000, help="per run (200,000)")
    parser.add_argument("--jibing", type=float, default=0.04, help="probability per hour (0.04)")
    parser.add_argument("--policy", default="greedy-posterior", help="makes the plans")
    parser.add_argument("--random", type=int, default=0, help="search in as many random incidents")
    parser.add_argument("--seed", type=int, default=1, help="of the random incidents (1)")
    parser.add_argument("--csv", type=Path, help="write the rows to this file")
    parser.add_argument("--coast", action="store_true", help="search in an eddy off a coast")
    parser.add_argument("--fast", action="store_true", help="two classes and one search")
    options = parser.parse_args()
    if options.coast:
        write(options.csv, [COAST_COLUMNS, *search_at_the_coast(options)])
        return
    classes = CLASSES
    incidents = INCIDENTS
    if options.fast:
        classes = CLASSES[:2]
        incidents = INCIDENTS[:1]
    if options.random:
        classes = ()
        incidents = random_incidents(options.random, options.seed)
    np.random.seed(0)  # OpenDrift draws from it

    rows = []
    excess = []
    print(f"{'object class':>23}  wind, m/s     time  distance  floor  means  sd of x, y")
    for name in classes:
        for wind in WINDS:
            for snapshot in snapshots(Incident(name, wind), options):
                rows += print_row(name, wind, snapshot, options)
    print(f"\n{'object class':>23}  wind, m/s     forecast  found")
    for incident in incidents:
        name = incident[0]
        wind = (round(incident.wind[0], 1), round(incident.wind[1], 1))
        if (success := search(incident, options)) is None:
            continue
        forecast, found = success
        excess.append(forecast - found)
        print(f"{name:>23}  {wind!s:<12}  {forecast:8.1%}  {found:.1%}", flush=True)
        hours = incident.adrift / 3600
        rows.append(("success", name, *wind, hours, f"{forecast:.4f}", f"{found:.4f}"))
    print(f"forecast - found: mean {np.mean(excess):.1%}, largest {max(excess):.1%}")
    write(options.csv, [COLUMNS, *rows])


def write(path: Path | None, rows: list[tuple[object, ...]]) -> None:
    """Write rows to a CSV file, if there is a path."""
    if path is not None:
        with path.open("w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows(rows)


if __name__ == "__main__":
    main()
