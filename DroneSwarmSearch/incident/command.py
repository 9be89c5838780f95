"""The command `plan`: from options to a folder with a plan, and one screen of results."""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import Any

from DroneSwarmSearch import leeway
from DroneSwarmSearch.incident import units
from DroneSwarmSearch.incident.flight_plan import POLICIES, QUICK, FlightPlan
from DroneSwarmSearch.incident.report import Incident, Pair

READERS: dict[str, Callable[[str], Any]] = {
    "position": units.position,
    "base": units.position,
    "wind": lambda text: _flow(leeway.wind_from, text),
    "current": lambda text: _flow(leeway.current_towards, text),
    "speed": partial(units.quantity, units=units.SPEED),
    "endurance": partial(units.quantity, units=units.TIME),
    **dict.fromkeys(
        ("position_sd", "swath", "altitude"), partial(units.quantity, units=units.LENGTH)
    ),
}
"""How the words of options become values; the words may be apart, as in 25 kn."""

MINUTES = 5, 10, 20, 30, 45, 60, 90, 120


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options; those of the incident have the names of its values."""
    parser.usage = (
        "%(prog)s --position LAT LON --time UTC\n"
        "           --object CLASS --wind DEGREES SPEED --out DIR [options]"
    )
    place: Any = {"metavar": ("LAT", "LON"), "nargs": "+"}
    flow: Any = {"metavar": ("DIRECTION", "SPEED"), "nargs": "+"}
    unit: Any = {"nargs": "+"}

    def add(name: str, about: str, value: str | None = None, **options: object) -> None:
        kinds: dict[str, object] = {"dest": value, **options} if value else options
        group.add_argument(name, help=about, **kinds)  # type: ignore[arg-type]

    group = parser.add_argument_group("the incident")
    add("--position", "last known, 54.18 7.85, or 54-10.8N 007-51.0E", **place)
    add(
        "--error",
        "its standard deviation along each axis (926m)",
        "position_sd",
        metavar="LENGTH",
        **unit,
    )
    add("--time", "when they were there: 2026-03-01T05:30Z")
    add("--object", "a key of leeway.CLASSES, such as PIW-1", "object_class", metavar="CLASS")
    add("--wind", "where it comes from, and its speed: 300 25kn, or NW 12.9m/s", **flow)
    add("--current", "where it flows to, and its speed: 160 0.5kn (none)", **flow)
    add("--tracks", "of a drift simulation, in place of object and wind", metavar="FILE")
    add("--incident", "a file incident.json; other options replace its values", metavar="FILE")
    add("--after", "a plan that was flown and found nobody: plan the next one", metavar="DIR")
    group = parser.add_argument_group("the drones")
    add(
        "--start", "first take-off (an hour after --time; with --after, half an hour after landing)"
    )
    add("--drones", "how many (3)", type=int, metavar="N")
    add("--speed", "over the ground (20m/s)", **unit)
    add("--swath", "width of the strip that a drone sees (200m)", **unit)
    about = "probability that it finds a person in the strip (0.8)"
    add("--detection", about, "probability_of_detection", type=float, metavar="P")
    add("--endurance", "from take-off to landing (45min)", **unit)
    add("--base", "where they take off and land (the last known position)", **place)
    add("--altitude", "of the flight (100m)", **unit)
    group = parser.add_argument_group("the plan")
    add("--policy", f"{' or '.join(POLICIES)} ({POLICIES[0]})", choices=POLICIES, default="planner")
    add("--out", "the folder to write", metavar="DIR", type=Path, required=True)


def run(options: argparse.Namespace) -> None:
    """Plan, write the folder, and print one screen."""
    from DroneSwarmSearch.incident import chart  # noqa: F401 (fails now, and not after planning)

    plan = _incident(options).plan(options.policy)
    plan.save(options.out)
    print(f"{summary(plan)}\nWritten to {options.out}.")


def _incident(options: argparse.Namespace) -> Incident:
    """The incident that the options describe."""
    for name, read in READERS.items():
        if words := getattr(options, name):
            try:
                setattr(options, name, read(" ".join(words)))
            except ValueError as error:
                option = {"position_sd": "error"}.get(name, name)
                raise ValueError(f"--{option}: {error}") from None
    values = {each.name: getattr(options, each.name, None) for each in fields(Incident)}
    given = {name: value for name, value in values.items() if value is not None}
    if options.after is not None:
        start, folder = given.pop("start", None), Path(options.after)
        flown = replace(_read(folder / "incident.json"), **given)
        return flown.after(folder / "plan.csv", start)
    if options.incident is not None:
        return replace(_read(Path(options.incident)), **given)
    return Incident(**given)


def _flow(of: Callable[[float, float], Pair], text: str) -> Pair:
    """A wind or current from a direction and a speed."""
    degrees, _, speed = text.partition(" ")
    return of(units.direction(degrees), units.quantity(speed, units.SPEED))


def _read(path: Path) -> Incident:
    try:
        return Incident.read(path)
    except (OSError, TypeError, ValueError) as error:
        raise ValueError(f"{path} must be the file of an incident: {error}") from None


def summary(plan: FlightPlan) -> str:
    """One screen: what the plan finds and when, what more would bring, and what it assumes."""
    incident, layout = plan.incident, plan.incident.layout
    began = min(each.time for each in plan.waypoints if each.searching)
    landed = max(flight[-1].time for flight in plan.flights)
    steps = {each: layout.grid.scale.whole_steps(60 * each) for each in MINUTES}
    success = [
        f"{plan.success[n]:.0%} after {m}" for m, n in steps.items() if n < len(plan.success)
    ]
    quick, *found = (
        each.plan(QUICK).probability_of_success
        for each in (
            incident,
            replace(incident, drones=incident.drones + 1),
            replace(incident, endurance=incident.endurance + 1800),
        )
    )
    drone, time = (f"{100 * (more - quick):+.0f}" for more in found)
    lines = [
        incident.sentence,
        f"After {len(incident.flown)} flights that found nobody." if incident.flown else "",
        f"PROBABILITY OF SUCCESS {plan.probability_of_success:.0%}: "
        f"{', '.join(success)} minutes in the area.",
        f"First take-off {incident.start:%H:%M}, in the area {began:%H:%M}, last landing "
        f"{landed:%H:%M} UTC. One more drone: {drone} points. Half an hour more: {time} points.",
        f"Assumed: the drift is right, up to a position error of {incident.position_sd:.0f} m and "
        f"the spread of such objects. Drones fly {incident.speed:.3g} m/s for at most "
        f"{incident.endurance / 60:.0f} min, at {incident.altitude:.0f} m, and find "
        f"{incident.probability_of_detection:.0%} of those in a strip of {incident.swath:.0f} m.",
        f"Map: {layout.grid.size} x {layout.grid.size} cells of "
        f"{layout.grid.scale.metres_per_cell:.0f} m.",
    ]
    return "\n".join(textwrap.fill(line, 79) for line in lines if line)
