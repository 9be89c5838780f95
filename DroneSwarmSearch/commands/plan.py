"""The command `plan`: from options to a folder with a plan, and one screen of results."""

from __future__ import annotations

import argparse
import re
import textwrap
from dataclasses import fields
from datetime import timedelta
from pathlib import Path
from typing import Any

from DroneSwarmSearch._internal.extras import needed
from DroneSwarmSearch.drift import leeway
from DroneSwarmSearch.incident.flight_plan import FlightPlan
from DroneSwarmSearch.incident.flows import stronger
from DroneSwarmSearch.incident.incident import Incident

NAMES = {
    "position_sd": "--error",
    "object_class": "--object",
    "probability_of_detection": "--detection",
}
"""Options that do not have the names of an incident's values."""

MINUTES = 5, 10, 20, 30, 45, 60, 90, 120


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options; those of the incident have the names of its values."""
    parser.usage = (
        "%(prog)s --position LAT LON --time UTC\n"
        "           --object CLASS --wind DEGREES SPEED --out DIR [options]"
    )
    words: Any = {"nargs": "+", "action": _Words}
    place: Any = {"metavar": ("LAT", "LON"), **words}
    flow: Any = {"metavar": ("DIRECTION", "SPEED"), "nargs": "+", "action": "append"}

    def add(name: str, about: str, value: str | None = None, **options: object) -> None:
        kinds: dict[str, object] = {"dest": value, **options} if value else options
        group.add_argument(name, help=about, **kinds)  # type: ignore[arg-type]

    group = parser.add_argument_group("the incident")
    add("--position", "last known: 54.18 7.85, or 54-10.8N 007-51.0E", **place)
    add("--error", "its standard deviation along each axis (926m)", "position_sd", **words)
    add("--time", "when they were there: 2026-03-01T05:30Z")
    add("--object", "a key of leeway.CLASSES, such as PIW-1", "object_class", metavar="CLASS")
    about = "where it comes from, and its speed: 300 25kn, or NW 12.9m/s; again for later times: "
    add("--wind", f"{about}320 30kn@08:00Z; or a CSV file of time, direction, speed", **flow)
    add("--current", "where it flows to, and its speed: 160 0.5kn (none)", **flow)
    add("--wind-file", "of a weather model, NetCDF, in place of --wind", metavar="FILE")
    add("--current-file", "of an ocean model", metavar="FILE")
    add("--wind-error", "standard deviation along each axis (2m/s)", **words)
    add("--current-error", "the same (0.13m/s)", **words)
    about = "of a drift simulation, in place of object and current"
    add("--tracks", about, metavar="FILE")
    add("--incident", "a file incident.json; other options replace its values", metavar="FILE")
    add("--after", "a plan that was flown and found nobody: plan the next one", metavar="DIR")
    group = parser.add_argument_group("the drones")
    add("--start", "take-off (an hour after --time; with --after, half an hour after landing)")
    add("--drones", "how many (3)", type=int, metavar="N")
    add("--speed", "airspeed (20m/s)", **words)
    add("--turn", "time for a turn by a right angle (4s)", **words)
    add("--swath", "width of the strip that a drone sees (200m)", **words)
    about = "probability that it finds a person in the strip (0.8)"
    add("--detection", about, "probability_of_detection", type=float, metavar="P")
    add("--endurance", "from take-off to landing (45min)", **words)
    add("--reserve", "what must be left of the endurance (none)", **words)
    add("--base", "where they take off and land (the last known position)", **place)
    add("--altitude", "of the first one; the others fly 20 m above each other (100m)", **words)
    group = parser.add_argument_group("the plan")
    add("--out", "the folder to write", metavar="DIR", type=Path, required=True)


class _Words(argparse.Action):
    """Joins words, so that 25 kn and 25kn are the same."""

    def __call__(self, parser: Any, namespace: Any, values: Any, option_string: Any = None) -> None:
        setattr(namespace, self.dest, " ".join(values))


def run(options: argparse.Namespace) -> None:
    """Plan, write the folder, and print one screen."""
    needed("matplotlib", "the map needs the package matplotlib", "plan")  # not after planning
    try:
        plan = _incident(options).plan()
    except ValueError as error:
        name, rest = re.fullmatch(r"(\w*)(.*)", str(error), re.DOTALL).groups()  # type: ignore[union-attr]
        option = NAMES.get(name, f"--{name.replace('_', '-')}")
        raise ValueError(f"{option if hasattr(options, name) else name}{rest}") from None
    plan.save(options.out)
    print(f"{summary(plan)}\nWritten to {options.out}.")


def _incident(options: argparse.Namespace) -> Incident:
    """The incident that the options describe."""
    values = {field.name: getattr(options, field.name, None) for field in fields(Incident)}
    for name in ("wind", "current"):
        if file := getattr(options, f"{name}_file"):
            values[name] = file
        elif texts := [" ".join(words) for words in values[name] or ()]:
            values[name] = texts[0] if len(texts) == 1 else texts
    given = {name: value for name, value in values.items() if value is not None}
    if options.after is not None:
        start, folder = given.pop("start", None), Path(options.after)
        flown = _read(folder / "incident.json", given)
        return flown.after(folder / "plan.csv", start)
    if options.incident is not None:
        return _read(Path(options.incident), given)
    return Incident(**given)


def _read(path: Path, given: dict[str, Any]) -> Incident:
    try:
        return Incident.read(path, **given)
    except (OSError, TypeError, ValueError):
        _check_file(path)
        raise  # it is about the options


def _check_file(path: Path) -> None:
    try:
        Incident.read(path)
    except (OSError, TypeError, ValueError) as error:
        raise ValueError(f"{path} must be the file of an incident: {error}") from None


def summary(plan: FlightPlan) -> str:
    """One screen: what the plan finds and when, the orders, what more would bring, what it assumes.

    What more would bring comes from quick plans, which begin with the patterns of this one.
    """
    incident, scene = plan.incident, plan.on_scene
    times = {minute: scene + timedelta(minutes=minute) for minute in MINUTES}
    success = [f"{plan.success(t):.0%} after {m}" for m, t in times.items() if t < plan.landed]
    changes: dict[str, dict[str, Any]] = {
        "One more drone": {"drones": incident.drones + 1},
        "Half an hour more": {"endurance": incident.endurance + 1800},
    }
    if incident.tracks is None and not isinstance(incident.wind, str):
        changes["A wind 5 kn stronger"] = {"wind": stronger(incident.wind, 5 * leeway.KNOT)}
    lines = [
        incident.sentence,
        f"After {len(incident.flown)} flights that found nobody." if incident.flown else "",
        f"PROBABILITY OF SUCCESS {plan.probability_of_success:.0%} by {plan.landed:%H:%M} UTC: "
        f"{', '.join(success)} minutes from {scene:%H:%M} on.",
        *plan.orders,
        " ".join(f"{name}: {_difference(plan, values)}." for name, values in changes.items()),
        "Assumed: " + " ".join(plan.assumptions),
    ]
    return "\n".join(textwrap.fill(line, 79) for line in lines if line)


def _difference(plan: FlightPlan, values: dict[str, Any]) -> str:
    """What other values change, in points, or that drones cannot fly then."""
    try:
        more = plan.with_changes(**values).probability_of_success
    except ValueError:
        return "drones cannot fly there and back"
    return f"{100 * (more - plan.probability_of_success):+.0f} points"
