"""The options of the demo, and the search that they name or describe."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from DroneSwarmSearch._internal import checks
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

USUAL_POLICY = "greedy-matrix"  # it needs only observations, so it also works while you fly drone 0
GRID_SIZE = 24  # of the search without a name


def parse(argv: Sequence[str] | None) -> tuple[argparse.ArgumentParser, argparse.Namespace]:
    """Parse the command line of the demo; returns the parser, for errors, and the options."""
    parser = _parser()
    options = parser.parse_args(argv)
    if options.manual and options.policy != USUAL_POLICY:
        parser.error(f"argument --manual: the other drones use {USUAL_POLICY}: leave out --policy")
    if options.search is not None and options.drones != parser.get_default("drones"):
        parser.error("argument --drones: not allowed with a SEARCH")
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
        "or a file of a search or an incident, .json",
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
    return parser


def search_of(options: argparse.Namespace) -> NamedSearch:
    """The search that the options name or describe; raises TypeError or ValueError."""
    checks.integer("--seed", options.seed, 0)
    checks.real("--fps", options.fps, FPS_LEAST, FPS_MOST)
    if options.search is not None:
        return search(options.search).with_posterior(not options.prior)
    scenario = Scenario(
        GRID_SIZE,
        checks.integer("--drones", options.drones, 1, 4 * (GRID_SIZE - 1)),
        vector=(0.16, 0.08),
        person_initial_position=((6, 9),),
        disperse_constant=2.0,
        timestep_limit=80,
        bayesian_update=not options.prior,
    )
    name = f"{GRID_SIZE} x {GRID_SIZE} cells"
    return NamedSearch(name, "Described by options.", scenario, _around_the_border(options.drones))


def _around_the_border(n_drones: int) -> tuple[Cell, ...]:
    """Start cells spread evenly around the border, clockwise from (0, 0)."""
    last = GRID_SIZE - 1
    top = [(x, 0) for x in range(last)]
    right = [(last, y) for y in range(last)]
    border = [*top, *right, *((last - x, last - y) for x, y in top + right)]
    return tuple(border[drone * len(border) // n_drones] for drone in range(n_drones))
