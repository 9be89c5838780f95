"""The options of the demo, and the search that they name or describe."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from DroneSwarmSearch import leeway
from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.drift.persons import MASS_BEYOND, Person, warn_of_mass_beyond
from DroneSwarmSearch.drift.scale import Scale
from DroneSwarmSearch.evaluation.suite import NamedSearch, search
from DroneSwarmSearch.policies import POLICIES
from DroneSwarmSearch.rendering.video import FPS_LEAST, FPS_MOST
from DroneSwarmSearch.scenario import Cell, Scenario

DESCRIPTION = """\
Drones search a grid at sea for shipwrecked persons who drift: watch a policy, or fly one drone
yourself. SEARCH names a search; without it, the drones start around the border, and the person is
expected in the middle of the grid halfway through the search. Every drone flies to the cell with
the highest probability, discounted by its distance (the policy "greedy-matrix"), unless you choose
another policy.
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

INCIDENT = """\
A person, raft or boat that drifts with the wind, in metres and seconds. For example:
--object-class PIW-1 --wind 240 20 --adrift 3600
"""

USUAL_POLICY = "greedy-matrix"  # it needs only observations, so it also works while you fly drone 0
OF_AN_INCIDENT = ("wind", "adrift", "cell", "drone_speed")
TIMESTEP_LIMIT = 80  # of every search without a name
GRID_LEAST, GRID_MOST = 20, 100  # cells along a side of the grid of an incident


def parse(argv: Sequence[str] | None) -> tuple[argparse.ArgumentParser, argparse.Namespace]:
    """Parse the command line of the demo; returns the parser, for errors, and the options."""
    parser = _parser()
    options = parser.parse_args(argv)
    if options.manual and options.policy != USUAL_POLICY:
        parser.error(f"argument --manual: the other drones use {USUAL_POLICY}: leave out --policy")
    if options.object_class is not None and options.wind is None:
        parser.error("argument --object-class: needs --wind FROM KNOTS")
    unused: tuple[str, ...] = ()
    if options.search is not None:
        unused, reason = ("drones", "object_class", *OF_AN_INCIDENT), "not allowed with a SEARCH"
    elif options.object_class is None:
        unused, reason = OF_AN_INCIDENT, "needs --object-class"
    for name in unused:
        if getattr(options, name) != parser.get_default(name):
            parser.error(f"argument --{name.replace('_', '-')}: {reason}")
    return parser, options


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m DroneSwarmSearch play",
        usage="%(prog)s [SEARCH] [options]",
        description=DESCRIPTION,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "search",
        metavar="SEARCH",
        nargs="?",
        help="a search of the suite, such as classic or gale (`evaluate --list` describes them), "
        "or a file of a search, .json",
    )
    view = parser.add_argument_group("view (a window if there is a display, otherwise text)")
    where = view.add_mutually_exclusive_group().add_argument
    where("--manual", action="store_true", help="fly drone 0 with the arrow keys")
    where("--text", action="store_true", help="stay in the terminal")
    where("--record", metavar="FILE", type=Path, help="write a video instead, .gif or .mp4")
    add = view.add_argument
    add("--hide-person", action="store_true", help="do not show missing persons")
    add("--fps", type=float, default=6.0, help="steps shown per second (default: 6)")
    add("--no-grid", action="store_true", help="draw no lines between the cells")
    add("--no-gradient", action="store_true", help="colour the cells in three steps")
    prior = "show the drones, and you, the forecast of the drift instead of the posterior"
    add("--prior", action="store_true", help=prior)

    policies = f"{', '.join(POLICIES)}, or a file of weights, .npz (default: {USUAL_POLICY})"
    add = parser.add_argument_group("episode").add_argument
    add("--policy", metavar="NAME", default=USUAL_POLICY, help=policies)
    seed = "seed of the persons' drift (default: 0)"
    add("--seed", metavar="N", type=int, default=0, help=seed)
    drones = "number of drones, without SEARCH (default: 4)"
    add("--drones", metavar="N", type=int, default=4, help=drones)

    wind = "where the wind comes from, in degrees, and its speed 10 m above the sea"
    what = "what drifts: a key of leeway.CLASSES, such as PIW-1, a person in the water"
    adrift = "from the last known position to the beginning of the search (default: 0)"
    swath = "side of a cell: the width of the strip that a drone sees (default: 130)"
    step = "a step is the time in which a drone crosses a cell (default: 10)"
    add = parser.add_argument_group("your search at sea, without SEARCH", INCIDENT).add_argument
    add("--object-class", metavar="CLASS", help=what)
    add("--wind", metavar=("FROM", "KNOTS"), nargs=2, type=float, help=wind)
    add("--adrift", metavar="SECONDS", type=float, default=0.0, help=adrift)
    add("--cell", metavar="METRES", type=float, default=130.0, help=swath)
    add("--drone-speed", metavar="M/S", type=float, default=10.0, help=step)
    return parser


def search_of(options: argparse.Namespace) -> NamedSearch:
    """The search that the options name or describe; raises TypeError or ValueError."""
    checks.integer("--seed", options.seed, 0)
    checks.real("--fps", options.fps, FPS_LEAST, FPS_MOST)
    if options.search is not None:
        return search(options.search).with_posterior(not options.prior)
    scale, reason = None, "Described by options."
    if options.object_class is None:
        scenario = Scenario(
            24, vector=(0.16, 0.08), person_initial_position=((6, 9),), disperse_constant=2.0
        )
    else:
        speed = checks.positive("--drone-speed", options.drone_speed)
        scale = Scale.for_drone(speed, checks.positive("--cell", options.cell))
        scenario = _incident(options, scale)
        wind = "wind from {:g}° at {:g} knots".format(*options.wind)
        what = leeway.CLASSES[options.object_class].description
        reason = f"{what}; {options.adrift / 60:.0f} minutes adrift, {wind}."
    size = scenario.grid_size
    scenario = scenario.replace(
        n_drones=checks.integer("--drones", options.drones, 1, 4 * (size - 1)),
        timestep_limit=TIMESTEP_LIMIT,
        bayesian_update=not options.prior,
    )
    drones = _around_the_border(scenario.n_drones, size)
    name = options.object_class or f"{size} x {size} cells"
    return NamedSearch(name, reason, scenario, drones, scale)


def _around_the_border(n_drones: int, grid_size: int) -> tuple[Cell, ...]:
    """Start cells spread evenly around the border, clockwise from (0, 0)."""
    last = grid_size - 1
    top = [(x, 0) for x in range(last)]
    right = [(last, y) for y in range(last)]
    border = [*top, *right, *((last - x, last - y) for x, y in top + right)]
    return tuple(border[drone * len(border) // n_drones] for drone in range(n_drones))


def _incident(options: argparse.Namespace, scale: Scale) -> Scenario:
    """The search for a person who drifts with the wind, on the smallest grid that holds it."""
    east, north = leeway.wind_from(*options.wind)
    person = leeway.person(
        options.object_class,
        start=(0, 0),
        wind=(east * leeway.KNOT, north * leeway.KNOT),
        adrift=checks.real("--adrift", options.adrift, 0),
        scale=scale,
    )
    for size in range(GRID_LEAST, GRID_MOST + 1):
        placed = _placed(person, size)
        steps = (0, TIMESTEP_LIMIT // 2, TIMESTEP_LIMIT)
        if all(placed.mass_beyond(size, step) <= MASS_BEYOND for step in steps):
            break
    warn_of_mass_beyond([placed], size, TIMESTEP_LIMIT, stacklevel=1)
    return Scenario(size, persons=(placed,))


def _placed(person: Person, grid_size: int) -> Person:
    """The person where the mean position halfway through the search is the middle of the grid."""
    steps = person.drifts[0].adrift + TIMESTEP_LIMIT / 2
    mean = np.average([drift.vector for drift in person.drifts], axis=0, weights=person.weights)
    start = np.rint(grid_size // 2 - steps * mean)
    if person.drifts[0].starts_in_known_cell:
        start = np.clip(start, 0.0, grid_size - 1)
    drifts = [
        replace(drift, start=tuple(np.add(drift.start, start).tolist())) for drift in person.drifts
    ]
    return replace(person, drifts=tuple(drifts))
