"""The options of the demo, and the search that they name or describe.

A search is one of the suite, a toy in cells and steps, or an incident at sea in metres and seconds.
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
from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.drift.persons import MASS_BEYOND, Person, warn_of_mass_beyond
from DroneSwarmSearch.drift.scale import Scale
from DroneSwarmSearch.evaluation.search_file import SUFFIX, search_from_file
from DroneSwarmSearch.evaluation.suite import NamedSearch, search
from DroneSwarmSearch.policies import POLICIES
from DroneSwarmSearch.rendering.palette import PALETTES
from DroneSwarmSearch.rendering.video import SUFFIXES
from DroneSwarmSearch.scenario import MISSIONS, Cell, Scenario

__all__ = ["around_the_border", "message_on_option", "parse", "search_of"]

DESCRIPTION = """\
Drones search a grid at sea for shipwrecked persons who drift: watch a policy, or fly one drone
yourself. SEARCH names a search of the suite; without it, the options describe the search. The
drones then start around the border, and the person is expected in the middle of the grid halfway
through the search. Every drone flies to the cell with the highest probability, discounted by its
distance (the policy "greedy-matrix"), unless you choose another policy.
"""

EXAMPLES = """\
examples:
  python -m DroneSwarmSearch play                              watch a search
  python -m DroneSwarmSearch play --manual --hide-person       fly drone 0 against the policies
  python -m DroneSwarmSearch play gale --policy greedy-forecast --seed 4
  python -m DroneSwarmSearch play classic --record classic.gif

Keys are listed in the window; Esc quits. With --manual, the arrow keys (or W, A, S, D) move drone
0, space searches its cell, and I waits; every key is one step for all drones. Moves off the grid
and into other drones are refused: they would end the search. With --hide-person, you see no more
than the policies do, and your result is compared with theirs at the end.
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

NOT_WITH_SEARCH = (
    *("object_class", *NEEDS_OBJECT, *NOT_WITH_OBJECT),
    *("drones", "grid_size", "persons", "probability_of_detection"),
)
"""Options that describe a search, in place of a named one."""

GRID_USUAL = 24
GRID_LEAST, GRID_MOST = 20, 100
"""By default, the grid of an incident has from `GRID_LEAST` to `GRID_MOST` cells along a side."""

TIMESTEP_LIMIT = 80


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
    if options.search is not None:
        for name in NOT_WITH_SEARCH:
            if getattr(options, name) != parser.get_default(name):
                parser.error(f"argument {_option(name)}: not allowed with a SEARCH")
    for name in NEEDS_OBJECT if options.object_class is None else NOT_WITH_OBJECT:
        if getattr(options, name) != parser.get_default(name):
            allowed = "needs" if options.object_class is None else "not allowed with"
            parser.error(f"argument {_option(name)}: {allowed} --object-class")
    if options.object_class is not None and options.wind is None:
        parser.error("argument --object-class: needs --wind FROM KNOTS")
    return parser, options


def _parser() -> argparse.ArgumentParser:
    started_as = Path(sys.argv[0]).stem if sys.argv else ""
    commands = {"__main__": "python -m DroneSwarmSearch", "droneswarmsearch": "droneswarmsearch"}
    command = commands.get(started_as)
    parser = argparse.ArgumentParser(
        prog=command and f"{command} play",
        usage="%(prog)s [SEARCH] [options]",
        description=DESCRIPTION,
        epilog=EXAMPLES,
        formatter_class=_HelpFormatter,
    )
    parser.add_argument(
        "search",
        metavar="SEARCH",
        nargs="?",
        help="a search of the suite, such as classic or gale (`evaluate --list` describes them), "
        "or a file of a search, .json",
    )
    flag = argparse.BooleanOptionalAction
    view = parser.add_argument_group("view (a window if there is a display, otherwise text)")
    add = view.add_argument
    add("--manual", action="store_true", help="fly drone 0 with the arrow keys")
    add("--hide-person", action="store_true", help="do not show missing persons")
    add("--text", action="store_true", help="stay in the terminal")
    add("--record", metavar="FILE", type=_video, help="write a video instead, .gif or .mp4")
    add("--fps", type=float, default=6.0, help="steps shown per second")
    add("--grid", action=flag, default=True, help="draw lines between the cells")
    add("--gradient", action=flag, default=True, help="colour the cells smoothly")
    add("--palette", choices=tuple(PALETTES), default="classic", help="colours of the cells")
    prior = "show the drones, and you, the forecast of the drift instead of the posterior"
    add("--prior", action="store_true", help=prior)

    policies = f"the drones' policy: {', '.join(POLICIES)}, or a file of weights, .npz"
    limit = f"time limit in steps (default: {TIMESTEP_LIMIT}, or those of SEARCH)"
    mission = "find the persons, or gain as much probability of success as possible"
    add = parser.add_argument_group("episode").add_argument
    add("--policy", metavar="NAME", default=USUAL_POLICY, help=policies)
    add("--seed", metavar="N", type=int, default=0, help="seed of the persons' drift")
    add("--timestep-limit", metavar="N", type=int, help=limit)
    add("--mission", choices=MISSIONS, help=f"{mission} (default: rescue, or that of SEARCH)")

    size = f"cells along a side (default: {GRID_USUAL}; in an incident, as many as hold 99%% of "
    size += f"the forecast, from {GRID_LEAST} to {GRID_MOST})"
    spread = "how quickly the persons may stray from the drift, at least 0"
    detection = "probability that a search of the person's cell finds the person, 0 to 1"
    group = parser.add_argument_group("your search, without SEARCH")
    group.add_argument("--drones", metavar="N", type=int, default=4, help="number of drones")
    group.add_argument("--grid-size", metavar="N", type=int, help=size)
    group.add_argument("--persons", metavar="N", type=int, default=1, help="number of persons")
    _add_pair(group, "--vector", "X", "Y", (0.16, 0.08), "drift in cells per step, y downward")
    _add_number(group, "--disperse-constant", "C", 2.0, spread)
    _add_number(group, "--probability-of-detection", "P", 1.0, detection)

    wind = "where the wind comes from, in degrees, and its speed 10 m above the sea"
    current = "where the current flows to, in degrees, and its speed"
    deviation = "standard deviation of the last known position, along each axis"
    step = "speed of the drones: a step is the time in which they cross a cell"
    what = "what drifts: a key of leeway.CLASSES, such as PIW-1, a person in the water"
    swath = "side of a cell: the width of the strip that a drone sees"
    adrift = "from the last known position to the beginning of the search"
    group = parser.add_argument_group("your search at sea, without SEARCH", INCIDENT)
    group.add_argument("--object-class", metavar="CLASS", help=what)
    _add_pair(group, "--wind", "FROM", "KNOTS", None, wind)
    _add_pair(group, "--current", "TOWARDS", "KNOTS", (0.0, 0.0), current)
    _add_number(group, "--position-sd", "METRES", 0.0, deviation)
    _add_number(group, "--adrift", "SECONDS", 0.0, adrift)
    _add_number(group, "--diffusivity", "M2/S", 5.0, "of the turbulent sea, usually 1 to 10")
    _add_number(group, "--cell", "METRES", 130.0, swath)
    _add_number(group, "--drone-speed", "M/S", 10.0, step)
    return parser


def _video(text: str) -> Path:
    if Path(text).suffix.lower() not in SUFFIXES:
        raise argparse.ArgumentTypeError(f"must end in .gif or .mp4, got {text!r}")
    return Path(text)


def _add_number(group: Any, option: str, metavar: str, default: float, text: str) -> None:
    group.add_argument(option, metavar=metavar, type=float, default=default, help=text)


def _add_pair(group: Any, option: str, one: str, other: str, default: Any, text: str) -> None:
    group.add_argument(
        option, metavar=(one, other), nargs=2, type=float, default=default, help=text
    )


class _HelpFormatter(argparse.ArgumentDefaultsHelpFormatter, argparse.RawDescriptionHelpFormatter):
    """Shows the defaults of options with a value; those of flags are obvious."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        if action.nargs == 0 or action.default is None:
            return action.help
        return super()._get_help_string(action)


def message_on_option(message: str) -> str:
    """An error message on a parameter, with the name of the option that sets it."""
    others = {
        **{"n_drones": "drones", "name": "policy"},
        **{"swath": "cell", "speed": "drone_speed"},
    }

    def start(match: re.Match[str]) -> str:
        name = match[1]
        option = "SEARCH" if name == "search" else _option(others.get(name, name))
        return f"argument {option}: must "

    return re.sub(r"^(\w+)(?:\[\d+\])? must ", start, message)


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


# The search.


def search_of(options: argparse.Namespace) -> NamedSearch:
    """The search that the options name or describe.

    Drones and user see the posterior of it, or the prior with `--prior`; the scenario states
    which.

    Raises:
        TypeError, ValueError: an option is invalid.
    """
    changes: dict[str, Any] = {"bayesian_update": not options.prior}
    if options.search is None:
        limit = TIMESTEP_LIMIT if options.timestep_limit is None else options.timestep_limit
        changes |= {"n_drones": options.drones, "timestep_limit": limit}
        changes |= {"mission": options.mission or "rescue"}
        scenario = _described(options, changes)
        drones = around_the_border(scenario.n_drones, scenario.grid_size)
        scale = None
        if options.object_class is not None:
            scale = Scale.for_drone(options.drone_speed, options.cell)
        size = scenario.grid_size
        name = options.object_class or f"{size} x {size} cells"
        return NamedSearch(name, "Described by options.", scenario, drones, scale)
    is_file = options.search.endswith(SUFFIX)
    named = search_from_file(Path(options.search)) if is_file else search(options.search)
    for name in ("timestep_limit", "mission"):
        if getattr(options, name) is not None:
            changes[name] = getattr(options, name)
    return replace(named, scenario=named.scenario.replace(**changes))


def around_the_border(n_drones: int, grid_size: int) -> tuple[Cell, ...]:
    """Start cells spread evenly around the border, clockwise from (0, 0).

    Empty if there are more drones than cells on the border: the environment then places them.
    """
    last = grid_size - 1
    border = [
        *((i, 0) for i in range(last)),
        *((last, i) for i in range(last)),
        *((last - i, last) for i in range(last)),
        *((0, last - i) for i in range(last)),
    ]
    if n_drones > len(border):
        return ()
    return tuple(border[drone * len(border) // n_drones] for drone in range(n_drones))


def _described(options: argparse.Namespace, common: Mapping[str, Any]) -> Scenario:
    """The scenario that the options describe."""
    checks.integer("persons", options.persons, 1)
    if options.object_class is not None:
        return _incident(options, common)
    size = GRID_USUAL if options.grid_size is None else options.grid_size
    start = _start_cell(checks.pair("vector", options.vector), size, common["timestep_limit"] / 2)
    return Scenario(
        grid_size=size,
        vector=options.vector,
        person_initial_position=(start,) * options.persons,
        disperse_constant=options.disperse_constant,
        probability_of_detection=options.probability_of_detection,
        **common,
    )


def _start_cell(vector: Sequence[float], grid_size: int, steps: float) -> Cell:
    """The cell from which the drift leads to the middle of the grid in some steps.

    It is not nearer to the border than a quarter of the grid, since the drones start there.
    """
    middle, least = grid_size // 2, grid_size // 4
    x, y = (min(max(round(middle - steps * each), least), grid_size - 1 - least) for each in vector)
    return x, y


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
        scale=Scale.for_drone(options.drone_speed, options.cell),
        probability_of_detection=options.probability_of_detection,
    )
    limit = common["timestep_limit"]
    size = options.grid_size
    if size is None:
        sizes = range(GRID_LEAST, GRID_MOST)
        size = next((n for n in sizes if _holds(_placed(person, n, limit), n, limit)), GRID_MOST)
    scenario = Scenario(size, persons=(_placed(person, size, limit),) * options.persons, **common)
    warn_of_mass_beyond(scenario.situation, size, limit, stacklevel=1)
    return scenario


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
