"""Simulate the tracks of the suite's searches in which the wind or the current changes.

    python docs/make_tracks.py
    python docs/make_tracks.py --seed 1 --into held-out
    python docs/make_tracks.py --compare docs/figures/tracks.json

The first command writes `tide.npz`, `eddy.npz` and `coast.npz`, 30,000 tracks each, beside the
suite's file in `DroneSwarmSearch/evaluation/`; then run `docs/make_suite.py`, which enters their
hashes. As the searches of a published version never change, neither do these files.

The second command writes new tracks of the same scenes, to test plans on. The third one makes plans
for the suite's tracks, and for a constant drift fitted to them, and measures which share of new
tracks they find; the figure `tracks` shows the result.

A track is an object that is lost near a known position, and drifts with the current, the wind and
the turbulence of the sea. Objects differ in their leeway. Half of them drift to the right of the
wind and half to the left, and now and then one changes sides. On land they stay.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch import Drift, Person, Scale, Tracks
from DroneSwarmSearch.evaluation import evaluate, share_found, suite
from DroneSwarmSearch.geo import current_towards, wind_from
from DroneSwarmSearch.policies import make

FOLDER = Path(suite.__file__).parent

TRACKS = 30_000
GRID_SIZE = 41
STEPS = 140
SCALE = Scale(metres_per_cell=250, seconds_per_step=90)
"""Drones fly at 2.8 m/s, and the searches last three and a half hours."""

SECONDS = 30.0
"""Duration of a time step of the simulation."""

DIFFUSIVITY = 5.0
"""Of the turbulent sea, in m²/s: a random walk of variance 2 K t along each axis."""

JIBING = 0.04 / 3600
"""The probability per second that an object changes to the other side of the wind."""

TIDE = 12.42 * 3600
"""Period of the principal lunar tide, in seconds."""

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


class Leeway(NamedTuple):
    """Leeway as a share of the wind speed: means and standard deviations over objects."""

    downwind: float
    downwind_sd: float
    crosswind: float
    crosswind_sd: float


SKIFF = Leeway(0.0315, 0.003, 0.0129, 0.003)
SWIMMER = Leeway(0.012, 0.004, 0.004, 0.002)
"""Similar to the classes SKIFF-1 and PIW-3 of `leeway.CLASSES`."""


class Scene(NamedTuple):
    """What drifts where. Positions are in metres (east, north) from the middle of the grid.

    Attributes:
        lost: the reported position of the loss, with `POSITION_SD`; the search begins `ADRIFT`
            seconds later, at time 0.
        leeway: of the object.
        wind: the velocity (east, north) in m/s, of the time in seconds.
        current: likewise, of the positions, shape (2, P), and the time.
        is_land: which of the positions are on land.
    """

    lost: tuple[float, float]
    leeway: Leeway
    wind: Callable[[float], tuple[float, float]]
    current: Callable[[Floats, float], Floats]
    is_land: Callable[[Floats], Flags] = lambda positions: np.zeros(positions.shape[1], np.bool_)


POSITION_SD = 500.0
ADRIFT = 1800.0


def veering(time: float) -> tuple[float, float]:
    """A wind of 8 m/s that veers from south-southwest to west-northwest during the search."""
    return wind_from(200 + 90 * min(max(time, 0.0) / 12_600, 1.0), 8.0)


def tidal(positions: Floats, time: float) -> Floats:
    """A tide along a channel, up to 1.1 m/s in its middle, which turns after an hour and a half."""
    speed = 1.1 * np.cos(2 * np.pi * (time + TIDE / 4 - 5400) / TIDE)
    along = np.array(current_towards(70, 1.0))
    across = along[0] * positions[1] - along[1] * positions[0]
    return along[:, None] * speed * np.exp(-0.5 * (across / 4000) ** 2)


def whirling(positions: Floats, time: float) -> Floats:
    """An eddy, fastest 1.8 km from its middle at 0.8 m/s, which itself drifts slowly."""
    drift = np.array(current_towards(60, 0.08))[:, None]
    east, north = (positions - drift * time) / 1800
    speed = 0.8 * np.exp(0.5 * (1 - east**2 - north**2))
    return drift + speed * np.array([-north, east])


def shore(north: Floats) -> Floats:
    """How far east the land begins: a headland between two bays."""
    return 3000 - 1500 * np.cos(north / 1300) * np.exp(-0.5 * (north / 3500) ** 2)


def along_the_shore(positions: Floats, time: float) -> Floats:
    """A current to the north, 0.25 m/s at the shore and weaker out at sea."""
    distance = shore(positions[1]) - positions[0]
    return np.stack([np.zeros(len(distance)), 0.25 * np.exp(-0.5 * (distance / 2500) ** 2)])


SCENES = {
    "tide": Scene((-2500, -1500), SKIFF, veering, tidal),
    "eddy": Scene((-1300, -900), SWIMMER, lambda time: wind_from(290, 7), whirling),
    "coast": Scene(
        (-2300, -1500),
        SKIFF,
        lambda time: wind_from(265, 12),
        along_the_shore,
        lambda positions: positions[0] >= shore(positions[1]),
    ),
}
"""The scenes, by the names of the searches."""


def simulate(scene: Scene, count: int = TRACKS, seed: int = 0) -> Tracks:
    """The tracks of a scene, from the beginning of the search."""
    rng = np.random.default_rng(seed)
    positions = np.array(scene.lost)[:, None] + POSITION_SD * rng.standard_normal((2, count))
    side = rng.choice([-1.0, 1.0], count)
    traits = rng.standard_normal((2, count))
    downwind = scene.leeway.downwind + scene.leeway.downwind_sd * traits[0]
    crosswind = scene.leeway.crosswind + scene.leeway.crosswind_sd * traits[1]
    middle = (GRID_SIZE - 1) / 2
    every = round(SCALE.seconds_per_step / SECONDS)
    cells = np.empty((STEPS + 1, count, 2))
    for step in range(-round(ADRIFT / SECONDS), every * STEPS + 1):
        if step >= 0 and step % every == 0:
            x, y = positions / SCALE.metres_per_cell
            cells[step // every] = np.stack([middle + x, middle - y], axis=1)
        east, north = scene.wind(step * SECONDS)
        right = np.array([north, -east])[:, None] * (side * crosswind)
        velocity = np.array([east, north])[:, None] * downwind + right
        velocity += scene.current(positions, step * SECONDS)
        turbulence = np.sqrt(2 * DIFFUSIVITY * SECONDS) * rng.standard_normal((2, count))
        afloat = ~scene.is_land(positions)
        positions = positions + afloat * (velocity * SECONDS + turbulence)
        side[rng.random(count) < JIBING * SECONDS] *= -1
    return Tracks(cells)


def constant_drift(tracks: Tracks, probability_of_detection: float) -> Person:
    """Fit two hypotheses of constant drift, one to each half of the tracks along their main axis.

    The means follow the line of least squares through the mean positions of the half. The standard
    deviations are those of its positions at the start and, up to the turbulence, at the end.
    """
    positions = tracks.positions
    steps = np.arange(tracks.steps + 1)
    some = positions[:: len(steps) // 6].transpose(1, 0, 2).reshape(len(tracks), -1)
    some = some - some.mean(axis=0)
    is_first = some @ np.linalg.eigh(some.T @ some)[1][:, -1] > 0
    diffusion = 2 * DIFFUSIVITY * SCALE.seconds_per_step / SCALE.metres_per_cell**2
    drifts = []
    for half in (is_first, ~is_first):
        vector, start = np.polyfit(steps, positions[:, half].mean(axis=1), 1)
        before = positions[0, half].var(axis=0)
        after = positions[-1, half].var(axis=0)
        grown = np.maximum(after - before - diffusion * steps[-1], 0)
        drifts.append(
            Drift(
                (start[0], start[1]),
                start_sd=tuple(np.sqrt(before)),
                vector=(vector[0], vector[1]),
                vector_sd=tuple(np.sqrt(grown) / steps[-1]),
                diffusion=diffusion,
                weight=half.mean(),
            )
        )
    return Person(drifts, probability_of_detection)


def compare(seed: int = 1, policies: Sequence[str] = ("planner", "greedy-posterior")) -> Any:
    """Forecast success of policies for both drift models, and the share of new tracks found."""
    scenes = {}
    for name, scene in SCENES.items():
        found = suite.search(name)
        new = simulate(scene, seed=seed)
        (person,) = found.scenario.persons_to_find
        constant = constant_drift(person.drift.tracks, person.probability_of_detection)
        results: dict[str, Any] = {policy: {} for policy in policies}
        for drift, each in (("tracks", person), ("constant", constant)):
            search = replace(found, scenario=found.scenario.replace(persons=each))
            for policy in policies:
                forecast = evaluate(policy, search, episodes=1, progress=False).success.value
                share = share_found(
                    new, make(policy, search.scenario), drones_positions=search.drones
                )
                results[policy][drift] = {"forecast": forecast, "found": share}
        scenes[name] = {"constant": constant.to_dict(), "results": results}
    return scenes


def main() -> None:
    """Write the tracks of every scene, or compare drift models."""
    parser = argparse.ArgumentParser(description="Simulate the tracks of searches of the suite.")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--into", type=Path, default=FOLDER, help="output folder")
    parser.add_argument("--compare", type=Path, metavar="FILE", help="compare drift models instead")
    chosen = parser.parse_args()
    if chosen.compare is not None:
        chosen.compare.write_text(json.dumps(compare(), indent=1) + "\n", encoding="utf-8")
        return
    chosen.into.mkdir(parents=True, exist_ok=True)
    for name, scene in SCENES.items():
        simulate(scene, seed=chosen.seed).save(chosen.into / f"{name}.npz")


if __name__ == "__main__":
    main()
