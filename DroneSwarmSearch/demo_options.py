"""The options of the demo, and the search that they describe.

The search is a toy in cells and steps, or an incident at sea in metres and seconds.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from DroneSwarmSearch import leeway
from DroneSwarmSearch.drift.persons import MASS_BEYOND, Person, warn_of_mass_beyond
from DroneSwarmSearch.drift.scale import Scale
from DroneSwarmSearch.policies import POLICIES
from DroneSwarmSearch.rendering.palette import PALETTES
from DroneSwarmSearch.scenario import MISSIONS, Scenario

__all__ = ["EPILOG", "message_on_option", "parse", "scale_of", "scenario_of"]

DESCRIPTION = """\
Drones search a grid at sea for shipwrecked persons who drift. The drones start around the
border, the persons in the middle; in an incident, the middle of the grid is where the persons are
expected halfway through the search. Every drone flies to the cell with the highest probability,
discounted by its distance (the policy "greedy-matrix"), unless you choose another policy or
fly drone 0 yourself.
"""

EPILOG = """\
keys in the window: Esc or Q quits. With --manual, arrow keys move drone 0, space searches
its cell, i or . idles; every key is one step for all drones. Stay inside the grid and away
from the other drones: leaving the grid and collisions end the search.
"""

USUAL_POLICY = "greedy-matrix"
"""It needs only observations, so it also works while you fly drone 0."""

INCIDENT = """\
Persons, rafts or boats that drift with wind and current, in metres and seconds. For example:
--object-class PIW-1 --wind 240 20 --current 60 0.5 --position-sd 500 --adrift 3600
"""

NEEDS_OBJECT = (
    *("wind", "current", "position_sd", "adrift", "diffusivity"),
    *("cell", "drone_speed"),
)
NOT_WITH_OBJECT = ("vector", "disperse_constant")
"""Options of an incident, and those whose place they take."""

GRID_USUAL, GRID_MOST = 20, 100
"""By default, the grid of an incident has from `GRID_USUAL` to `GRID_MOST` cells along a side."""


def parse(argv: Sequence[str] | None) -> tuple[argparse.ArgumentParser, argparse.Namespace]:
    """Parse the command line of the demo.

    Args:
        argv: the arguments; those of the process if None.

    Returns:
        The parser, for errors, and the options.

    Raises:
        SystemExit: after `--help` (code 0), or if an option is invalid (code 2).
    """
    parser = _parser()
    options = parser.parse_args(argv)
    if options.manual and (options.text or options.record):
        parser.error("argument --manual: needs the window, so not with --text or --record")
    if options.manual and options.policy != USUAL_POLICY:
        parser.error(
            f"argument --manual: the other drones use {USUAL_POLICY}, so --policy is not allowed"
        )
    for name in NEEDS_OBJECT if options.object_class is None else NOT_WITH_OBJECT:
        if getattr(options, name) != parser.get_default(name):
            allowed = "needs" if options.object_class is None else "not allowed with"
            parser.error(f"argument {_option(name)}: {allowed} --object-class")
    if options.object_class is not None and options.wind is None:
        parser.error("argument --object-class: needs --wind FROM KNOTS")
    return parser, options


def _parser() -> argparse.ArgumentParser:
    started_as = Path(sys.argv[0]).name if sys.argv else ""
    parser = argparse.ArgumentParser(
        prog="python -m DroneSwarmSearch" if started_as == "__main__.py" else None,
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=_HelpFormatter,
    )
    flag = argparse.BooleanOptionalAction
    view = parser.add_argument_group("view (a window if there is a display, otherwise text)")
    add = view.add_argument
    add("--manual", action="store_true", help="fly drone 0 with the arrow keys")
    add("--text", action="store_true", help="stay in the terminal")
    add("--record", metavar="FILE", type=Path, help="write a video instead, .gif or .mp4")
    add("--fps", type=float, default=6.0, help="steps shown per second")
    add("--grid", action=flag, default=True, help="draw lines between the cells")
    add("--gradient", action=flag, default=True, help="colour the cells smoothly")
    add("--palette", choices=tuple(PALETTES), default="classic", help="colours of the cells")
    add(
        "--prior",
        action="store_true",
        help="show the forecast of the drift instead of the posterior, to you and to the drones",
    )
    add = parser.add_argument_group("search").add_argument
    add(
        "--policy",
        metavar="NAME",
        default=USUAL_POLICY,
        help=f"the drones' policy: {', '.join(POLICIES)}, or a file of weights, .npz",
    )
    add("--drones", metavar="N", type=int, default=4, help="number of drones")
    add(
        "--grid-size",
        metavar="N",
        type=int,
        help=f"cells along a side (default: {GRID_USUAL}; in an incident, as many as hold 99%% of "
        f"the forecast, at most {GRID_MOST})",
    )
    add("--persons", metavar="N", type=int, default=1, help="number of persons")
    add(
        "--vector",
        metavar=("X", "Y"),
        nargs=2,
        type=float,
        default=(0.2, 0.1),
        help="drift in cells per step, y downward",
    )
    add(
        "--disperse-constant",
        metavar="C",
        type=float,
        default=3.0,
        help="how quickly the persons may stray from the drift, at least 0",
    )
    add("--timestep-limit", metavar="N", type=int, default=100, help="most steps")
    add(
        "--probability-of-detection",
        metavar="P",
        type=float,
        default=1.0,
        help="probability that a search of the person's cell finds the person, 0 to 1",
    )
    add(
        "--mission",
        choices=MISSIONS,
        default="rescue",
        help="find the persons, or gain as much probability of success as possible",
    )
    add("--seed", metavar="N", type=int, default=12, help="seed of the persons' drift")
    _add_incident(parser.add_argument_group("incident", INCIDENT).add_argument)
    return parser


def _add_incident(add: Callable[..., object]) -> None:
    """Add the options of an incident."""
    add(
        "--object-class",
        metavar="CLASS",
        help="what drifts: a key of leeway.CLASSES, such as PIW-1, a person in the water",
    )
    add(
        "--wind",
        metavar=("FROM", "KNOTS"),
        nargs=2,
        type=float,
        help="where the wind comes from, in degrees, and its speed 10 m above the sea",
    )
    add(
        "--current",
        metavar=("TOWARDS", "KNOTS"),
        nargs=2,
        type=float,
        default=(0.0, 0.0),
        help="where the current flows to, in degrees, and its speed",
    )
    add(
        "--position-sd",
        metavar="METRES",
        type=float,
        default=0.0,
        help="standard deviation of the last known position, along each axis",
    )
    add(
        "--adrift",
        metavar="SECONDS",
        type=float,
        default=0.0,
        help="from the last known position to the beginning of the search",
    )
    add(
        "--diffusivity",
        metavar="M2/S",
        type=float,
        default=5.0,
        help="of the turbulent sea, usually 1 to 10",
    )
    add(
        "--cell",
        metavar="METRES",
        type=float,
        default=130.0,
        help="side of a cell: the width of the strip that a drone sees",
    )
    add(
        "--drone-speed",
        metavar="M/S",
        type=float,
        default=10.0,
        help="speed of the drones: a step is the time in which they cross a cell",
    )


class _HelpFormatter(argparse.ArgumentDefaultsHelpFormatter):
    """Shows the defaults of options with a value; those of flags are obvious."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        if action.nargs == 0 or action.default is None:
            return action.help
        return super()._get_help_string(action)


def message_on_option(message: str) -> str:
    """An error message on a parameter, with the name of the option that sets it."""
    others = {
        **{"n_drones": "drones", "name": "policy", "path": "record"},
        **{"swath": "cell", "speed": "drone_speed"},
    }

    def start(match: re.Match[str]) -> str:
        return f"argument {_option(others.get(match[1], match[1]))}: must "

    return re.sub(r"^(\w+)(?:\[\d+\])? must ", start, message)


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


# The search.


def scenario_of(options: argparse.Namespace) -> Scenario:
    """The search that the options describe."""
    common = {
        "n_drones": options.drones,
        "timestep_limit": options.timestep_limit,
        "bayesian_update": not options.prior,
        "mission": options.mission,
    }
    if options.object_class is not None:
        return _incident(options, common)
    size = GRID_USUAL if options.grid_size is None else options.grid_size
    centre = size // 2
    return Scenario(
        grid_size=size,
        vector=options.vector,
        person_initial_position=((centre, centre),) * options.persons,
        disperse_constant=options.disperse_constant,
        probability_of_detection=options.probability_of_detection,
        **common,
    )


def _incident(options: argparse.Namespace, common: Mapping[str, Any]) -> Scenario:
    """The search for persons who drift with wind and current.

    Unless the options give its size, the grid is the smallest that holds the forecast.
    """
    person = leeway.person(
        options.object_class,
        start=(0, 0),
        position_sd=options.position_sd,
        wind=_flow("wind", leeway.wind_from, options.wind),
        current=_flow("current", leeway.current_towards, options.current),
        diffusivity=options.diffusivity,
        adrift=options.adrift,
        scale=scale_of(options),
        probability_of_detection=options.probability_of_detection,
    )
    limit = options.timestep_limit
    size = options.grid_size
    if size is None:
        sizes = range(GRID_USUAL, GRID_MOST)
        size = next((n for n in sizes if _holds(_placed(person, n, limit), n, limit)), GRID_MOST)
    scenario = Scenario(size, persons=(_placed(person, size, limit),) * options.persons, **common)
    warn_of_mass_beyond(scenario.situation, size, limit, stacklevel=1)
    return scenario


def scale_of(options: argparse.Namespace) -> Scale:
    """The scale of an incident."""
    return Scale.for_drone(options.drone_speed, options.cell)


def _flow(
    name: str, vector: Callable[[float, float], tuple[float, float]], given: Sequence[float]
) -> tuple[float, float]:
    """A wind or a current in m/s, (east, north), from degrees and knots."""
    try:
        east, north = vector(*given)
    except ValueError as error:
        raise ValueError(f"{name} must be degrees and knots: {error}") from None
    return east * leeway.KNOT, north * leeway.KNOT


def _placed(person: Person, grid_size: int, timestep_limit: int) -> Person:
    """The person where the mean position halfway through the search is the middle of the grid."""
    centre, last = grid_size // 2, grid_size - 1
    steps = person.drifts[0].adrift + timestep_limit / 2
    mean = np.average([drift.vector for drift in person.drifts], axis=0, weights=person.weights)
    x, y = np.rint(centre - steps * mean).tolist()
    if person.drifts[0].starts_in_known_cell:
        x, y = (min(max(cell, 0.0), last) for cell in (x, y))
    return replace(person, drifts=tuple(replace(drift, start=(x, y)) for drift in person.drifts))


def _holds(person: Person, grid_size: int, timestep_limit: int) -> bool:
    """Whether a grid holds the forecast at the start, halfway and at the end."""
    steps = (0, timestep_limit // 2, timestep_limit)
    return all(person.mass_beyond(grid_size, step) <= MASS_BEYOND for step in steps)
