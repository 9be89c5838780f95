"""The command `plan`: from options to a folder with a plan, and one screen of results."""

from __future__ import annotations

import argparse
import contextlib
import textwrap
import time
from dataclasses import fields, replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.extras import import_matplotlib
from DroneSwarmSearch._internal.text import enumerated
from DroneSwarmSearch.commands.options import Once
from DroneSwarmSearch.incident.files import write
from DroneSwarmSearch.incident.files.folder import INCIDENT, listed, try_plan_folder
from DroneSwarmSearch.incident.flight_plan import FlightPlan
from DroneSwarmSearch.incident.flights import up_to_the_minute
from DroneSwarmSearch.incident.hypothesis import PLACES
from DroneSwarmSearch.incident.incident import FLOWS, Incident
from DroneSwarmSearch.incident.planning import alternatives, plan
from DroneSwarmSearch.incident.sorties import after
from DroneSwarmSearch.rendering.text import WIDTH

NAMES = {
    "position_error": "--error",
    "object_class": "--object",
    "probability_of_detection": "--detection",
}
"""Options that do not have the names of an incident's values."""

SECONDS = 15.0

AFTERWARDS = 9.0
"""CPU seconds that figures, alternatives and files take."""

MINUTES = (5, 10, 20, 30, 45, 60, 90, 120)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options; those of the incident have the names of its values."""
    parser.usage = (
        "%(prog)s --position LAT LON --time UTC\n"
        "           --object CLASS --wind DEGREES SPEED --out DIR [options]"
    )
    parser.set_defaults(names=NAMES)
    words: Any = {"nargs": "+", "action": _Words}
    position: Any = {"metavar": ("LAT", "LON"), **words}
    flow: Any = {"metavar": ("DIRECTION", "SPEED"), "nargs": "+", "action": "append"}

    def add(name: str, about: str, value: str | None = None, **options: object) -> None:
        kinds: dict[str, object] = {"dest": value, **options} if value else options
        group.add_argument(name, help=about, **kinds)  # type: ignore[arg-type]

    group = parser.add_argument_group("the incident")
    add("--position", "last known: 54.18 7.85, or 54-10.8N 007-51.0E", **position)
    about = "in its place, a passage: positions with semicolons between them"
    add("--line", about, metavar='"A; B"', **words)
    about = "in its place, a GeoJSON file with polygons, or corners with semicolons between them"
    add("--area", about, metavar="FILE", **words)
    about = "standard deviation along each axis (926m; of an area 0); or 3NM probable, 3NM 95%%"
    add("--error", about, "position_error", **words)
    about = "when they were there: 2026-03-01T05:30Z; or two times, between which it happened"
    add("--time", about, metavar="UTC", nargs="+")
    about = "a key of leeway.CLASSES, such as PIW-1; or PIW-1:0.3, and again for other ones"
    add("--object", about, "object_class", metavar="CLASS", action="append")
    about = "in which an observer at the position saw them: 045"
    add("--bearing", about, metavar="DEGREES")
    add("--distance", "at which the observer saw them: 5NM", **words)
    add("--bearing-error", "its standard deviation (2 degrees)", **words)
    add("--distance-error", "the same (a tenth of the distance)", **words)
    about = "where it comes from, and its speed: 300 25kn, or NW 12.9m/s; again for later times: "
    add("--wind", f"{about}320 30kn@08:00Z; or a CSV file of time, direction, speed", **flow)
    add("--current", "where it flows to, and its speed: 160 0.5kn (none)", **flow)
    add("--wind-file", "of a weather model, NetCDF, in place of --wind", metavar="FILE")
    add("--current-file", "of an ocean model", metavar="FILE")
    add("--wind-error", "standard deviation along each axis (2m/s)", **words)
    add("--current-error", "the same (0.13m/s)", **words)
    about = "of a drift simulation, in place of object and current"
    add("--tracks", about, metavar="FILE")
    add("--coast", "none, or a GeoJSON file with polygons of land (GSHHG)", metavar="FILE")
    add("--incident", "a file incident.json; other options replace its values", metavar="FILE")
    add("--after", "a plan that was flown and found nobody: plan the next one", metavar="DIR")
    about = "a drone of --after that broke off its search, by name or number, and when: 2 07:10Z"
    add("--broke-off", about, nargs=2, action="append", metavar=("DRONE", "UTC"), default=[])
    group = parser.add_argument_group("the drones")
    add("--start", "take-off (an hour after --time; with --after, half an hour after landing)")
    add("--drones", "how many (3)", type=int, metavar="N")
    about = "in place of their number, a CSV file with a row for each drone, helicopter and boat"
    add("--fleet", about, metavar="FILE")
    add("--visibility", "at sea: what helicopters and boats see depends on it (10NM)", **words)
    add("--speed", "airspeed (20m/s)", **words)
    add("--turn", "time for a turn by a right angle (4s)", **words)
    about = (
        "width of the strip that a drone sees (200m); or PIW-1:100m, and again for other classes"
    )
    add("--swath", about, nargs="+", action="append", metavar="WIDTH")
    about = "probability that it finds a person in the strip (0.8), or PIW-1:0.6 and so on"
    add("--detection", about, "probability_of_detection", metavar="P", action="append")
    add("--endurance", "from take-off to landing (45min)", **words)
    add("--reserve", "what must be left of the endurance (a fifth of it)", **words)
    add("--base", "where they take off and land (the last known position)", **position)
    add(
        "--altitude", "of the first one; the others fly 20 m above each other (up to 100m)", **words
    )
    add("--ceiling", "above which none flies (120m)", **words)
    add("--floor", "below which none flies (20m)", **words)
    add("--climb", "speed with which they climb and sink (3m/s)", **words)
    about = "copter or plane, with ArduPilot or PX4, or dji: what the missions are for (copter)"
    add("--aircraft", about, metavar="KIND")
    about = "areas that none enters: a GeoJSON file with polygons, or corners with semicolons"
    add("--no-fly", about, metavar="FILE", **words)
    about = "they can also search after sunset: without, they must have ended by then"
    add("--night", about, action="store_true", default=None)
    group = parser.add_argument_group("the plan")
    add("--out", "the folder to write", metavar="DIR", type=Path, required=True)
    about = "CPU time in which the plan is improved; a first one takes some seconds (15)"
    add("--seconds", about, type=float, default=SECONDS, metavar="S")
    about = "do not compute what one more drone, more time and a stronger wind would change"
    add("--no-alternatives", about, action="store_true")


class _Words(Once):
    """Joins words, so that 25 kn and 25kn are the same."""

    def __call__(self, parser: Any, namespace: Any, values: Any, option_string: Any = None) -> None:
        super().__call__(parser, namespace, " ".join(values), option_string)


def run(options: argparse.Namespace) -> None:
    """Plan, print one screen, and write the folder."""
    import_matplotlib("the map needs the package matplotlib", "plan")  # not after planning
    checks.positive("--seconds", options.seconds)
    is_new = not options.out.exists()
    try:
        incident = _incident(options)
        try_plan_folder(options.out)
        left = options.seconds - AFTERWARDS - time.process_time()
        made = plan(incident, seconds=max(left, 1.0))
    except (TypeError, ValueError):
        if is_new:
            with contextlib.suppress(OSError):
                options.out.rmdir()  # it is empty
        raise
    try:
        print("\n".join(summary(made)), flush=True)
        more = []
        if not options.no_alternatives:
            for alternative in alternatives(made):
                print(alternative.sentence, flush=True)
                more.append(alternative)
        made = replace(made, alternatives=tuple(more))
    finally:  # also if nobody reads the summary
        left = write(made, options.out)
    print(f"Written to {options.out}.")
    if left:
        print(f"Left there, because no plan has written it: {listed(left)}.")


def _incident(options: argparse.Namespace) -> Incident:
    """The incident that the options describe."""
    if options.after is not None and options.incident is not None:
        raise ValueError("--after cannot be given together with --incident")
    _check_places(options)
    names = [field.name for field in fields(Incident) if field.init]
    values = {name: getattr(options, name, None) for name in names}
    for name in FLOWS:
        file = getattr(options, f"{name}_file")
        if file is not None and values[name] is not None:
            raise ValueError(f"--{name} cannot be given together with --{name}-file")
        texts = [" ".join(words) for words in values[name] or ()]
        if file is not None:
            values[name] = file
        elif texts:
            values[name] = texts[0] if len(texts) == 1 else texts
    for name in ("swath", "probability_of_detection"):
        given_often: Any = values[name]
        if given_often is not None:
            values[name] = _by_class(name, given_often)
    if values["object_class"] is not None:
        values["object_class"] = _object_classes(values["object_class"])
    given = {name: value for name, value in values.items() if value is not None}
    if options.after is not None:
        start = given.pop("start", None)
        folder = Path(options.after)
        before = _read(folder / INCIDENT, {})
        broke_off = _broke_off(options.broke_off)
        return after(before, folder / "plan.csv", start, broke_off=broke_off, **given)
    if options.broke_off:
        raise ValueError("--broke-off needs --after, the plan that was flown")
    if options.incident is not None:
        return _read(Path(options.incident), given)
    return Incident(**given)


def _check_places(options: argparse.Namespace) -> None:
    """Raise a ValueError for several places: one would be ignored."""
    given = [f"--{name}" for name in PLACES if getattr(options, name) is not None]
    if len(given) > 1:
        raise ValueError(
            f"one of --position, --line and --area may be given, got {enumerated(given)}"
        )


def _broke_off(given: list[list[str]]) -> dict[object, datetime | str]:
    """When drones broke off, by their names."""
    times: dict[object, datetime | str] = {}
    for name, when in given:
        if name in times:
            raise ValueError(f"--broke-off must be given once for each drone, got {name} twice")
        times[name] = when
    return times


def _by_class(name: str, given: list[Any]) -> str:
    """A value, or one for each object class, from all times that an option was given."""
    texts = [each if isinstance(each, str) else " ".join(each) for each in given]
    if len(texts) > 1 and not all(":" in text for text in texts):
        raise ValueError(
            f"{name} must be given once, or as CLASS:VALUE for each object class, got "
            f"{enumerated(texts)}"
        )
    return "; ".join(texts)


def _object_classes(texts: list[str]) -> str | list[tuple[str, float]]:
    """Object classes from texts such as "PIW-1", or "PIW-1:0.3" if there are several."""
    if len(texts) == 1 and ":" not in texts[0]:
        return texts[0]
    weighted = []
    for text in texts:
        name, _, weight = text.partition(":")
        try:
            weighted.append((name, float(weight)))
        except ValueError:
            raise ValueError(
                "object_class must be CLASS:WEIGHT, such as PIW-1:0.3, if there are several, got "
                f"{text!r}"
            ) from None
    return weighted


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


def summary(made: FlightPlan) -> list[str]:
    """The lines of one screen: what the plan finds and when, the orders, and what it assumes."""
    scene = made.on_scene
    by_minute = []
    for minutes in MINUTES:
        time = scene + timedelta(minutes=minutes)
        if time < made.landed:
            by_minute.append(f"{made.success(time):.0%} after {minutes}")
    success = f"PROBABILITY OF SUCCESS {made.probability_of_success:.0%} by {made.landed:%H:%M} UTC"
    if by_minute:
        begin = up_to_the_minute(scene)
        success += f": {', '.join(by_minute)} minutes from {begin:%H:%M} on"
    if made.incident.flown:
        success += f". With the earlier flights, {made.cumulative:.0%}"
    paragraphs = [
        made.incident.sentence,
        " ".join(made.earlier),
        f"{success}. {made.success_by_part}".rstrip(),
        " ".join(made.briefing),
        *made.orders,
        "Assumed: " + " ".join(made.assumptions),
    ]
    lines = []
    for paragraph in paragraphs:
        lines += textwrap.wrap(paragraph, WIDTH)
    return lines
