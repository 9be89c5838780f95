"""The command line: `python -m DroneSwarmSearch` and `droneswarmsearch`."""

from __future__ import annotations

import argparse
import importlib.util
import io
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from DroneSwarmSearch import demo
from DroneSwarmSearch._internal.errors import did_you_mean
from DroneSwarmSearch.layouts import LAYOUTS
from DroneSwarmSearch.policies import POLICIES
from DroneSwarmSearch.scenario import MISSIONS

__all__ = ["main"]

PROGRAM = "python -m DroneSwarmSearch"

COMMANDS = {
    "play": "watch a search in a window or in the terminal, or fly a drone; the default",
    "evaluate": "evaluate a policy on searches of the suite",
    "leaderboard": "compare all policies on the suite: tables, plots, files",
    "bound": "compute upper bounds on the success of any policy",
    "record": "record a video of a search: the prior and the posterior",
    "export": "write episodes of a search as JSON, to play them in a browser",
}

EVALUATE = """\
Evaluate a policy on searches of the suite or of files. Success is the share of episodes in
which every person is found by the time limit; time is the restricted mean time to find
(failures count with the limit); return is the mean return of the team; crashes are episodes in
which drones collided or left the grid. Coverage missions are judged by the probability of success
(POS) of the searches made; coverage and repetition are the different cells searched and the
repeated searches, both divided by the number of cells. Success and time are exact for
deterministic policies and one person; other figures have 95% intervals. For the same seed, all
policies use common random numbers.
"""

EVALUATE_EXAMPLES = """\
examples:
  python -m DroneSwarmSearch evaluate --list
  python -m DroneSwarmSearch evaluate greedy-posterior classic man-overboard --bound
  python -m DroneSwarmSearch evaluate planner all --workers 2 --out results
  python -m DroneSwarmSearch evaluate parallel-sweep pond my_search.json --mission coverage
  python -m DroneSwarmSearch evaluate my_network.py:policy classic --posterior
  python -m DroneSwarmSearch evaluate my_network.py:policy classic --view drone --observation flat

Your own policy is a callable from observations to actions, or a class that is instantiated with
the search's Scenario. --view and --observation select what it sees: "swarm" and "drone" are the
observations of SwarmVectorEnv and DroneVectorEnv, "parallel" has PettingZoo's form. With
--action-mask it sees {"observation": ..., "action_mask": ...}. The file or module is executed,
with everything it imports: only name code that you trust.

A file of a search, .json, holds the data of Scenario.to_dict, and may hold the start cells of the
drones, "drones_positions".

With --out, finished results are kept in DIR/finished, and the same command resumes after an
interruption. Exit codes: 0 done, 1 failed, 2 wrong arguments, 130 interrupted.
"""

OWN_POLICY = (
    "your own: weights.npz of examples/train_ppo.py, module:attribute or file.py:attribute, "
    "whose code is executed; each also after name="
)

SEARCH = "of the suite, or a file of a search, .json"

LEADERBOARD = """\
Evaluate every policy on every search of the suite, in the same episodes; print tables, and write
leaderboard.csv and plots to DIR (default: leaderboard).
"""

LEADERBOARD_EXAMPLES = """\
examples:
  python -m DroneSwarmSearch leaderboard
  python -m DroneSwarmSearch leaderboard --episodes 200 --searches pond fog --workers 2
  python -m DroneSwarmSearch leaderboard --add my_policies.py:MyPolicy --out mine

Finished results are kept in DIR/finished, and the same command resumes after an interruption.
Exit codes: 0 done, 1 failed, 2 wrong arguments, 130 interrupted.
"""

BOUND = """\
Compute a certified upper bound on the probability that any policy finds every person, within
the time limit and within each earlier step. In a coverage mission it is a bound on the
probability of success (POS) of any searches.
"""

BOUND_EXAMPLES = """\
examples:
  python -m DroneSwarmSearch bound pond harbour
  python -m DroneSwarmSearch bound all --workers 2 --json > bounds.json
"""

RECORD = """\
Record a video of one search: the prior on the left, the posterior on the right, with the same
drones and persons.
"""

RECORD_EXAMPLES = """\
examples:
  python -m DroneSwarmSearch record classic --policy greedy-posterior --out classic.gif
  python -m DroneSwarmSearch record fog --policy parallel-sweep --seed 7 --out fog.mp4

The video shows the episode that `evaluate` plays with the same seed. The left half shows the
prior, which only follows the drift; the right half shows the exact posterior given the searches
made. Colours range from 0 to the likeliest cell of each half.
"""

EXPORT = """\
Write the episodes of some policies on a search as JSON: actions, persons, probability of success,
returns, prior and posterior of every step. The page "Play a search" of the documentation plays
such files; `evaluation.export` documents their format.
"""

EXPORT_EXAMPLES = """\
examples:
  python -m DroneSwarmSearch export harbour --policies planner ppo --seeds 0 1 --out harbour.json
  python -m DroneSwarmSearch export fog --policies my_policy.py:MyPolicy planner --out fog.json

Each policy plays one episode for each seed, the one that `evaluate` and `record` play.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command.

    Args:
        argv: the arguments; None for those of the process.

    Returns:
        The exit code.

    Raises:
        SystemExit: help was requested (code 0), or an argument is wrong (code 2).
    """
    if argv is None:
        argv = sys.argv[1:]
        if isinstance(sys.stdout, io.TextIOWrapper):
            # An ASCII terminal shows "?" for missing characters, instead of failing.
            sys.stdout.reconfigure(errors="replace")
    code = _run(argv)
    try:
        sys.stdout.flush()
    except OSError as error:
        # Python must not fail again when it flushes the rest.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if code == 0 and not isinstance(error, BrokenPipeError):
            print(f"cannot write the output: {error.strerror}", file=sys.stderr)
        return code or 1
    return code


def _run(argv: Sequence[str]) -> int:
    """Run a command; returns the exit code."""
    command, *rest = argv or ("play",)
    if command == "play":
        return demo.main(rest)
    if command.startswith("-") and command not in ("-h", "--help"):
        return demo.main(argv)
    parser = _parser()
    if not command.startswith("-") and command not in COMMANDS:
        hint = did_you_mean(command, COMMANDS)
        print(f"no such command: {command!r:.100}{hint}\n", file=sys.stderr)
        parser.print_help(sys.stderr)
        return 2
    options = parser.parse_args(argv)
    from DroneSwarmSearch.evaluation import commands  # here, so that `play` starts faster

    code: int = getattr(commands, command)(options.parser, options)
    return code


def _format(prog: str) -> argparse.HelpFormatter:
    return argparse.RawDescriptionHelpFormatter(prog, max_help_position=28)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=PROGRAM,
        formatter_class=_format,
        usage=f"{PROGRAM} [play [SEARCH]] [options]\n       {PROGRAM} COMMAND [arguments]",
        epilog=f"`{PROGRAM} COMMAND --help` describes the options of each, with examples.",
    )
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", prog=PROGRAM)

    def add(name: str, description: str, examples: str) -> argparse.ArgumentParser:
        command = commands.add_parser(
            name,
            help=COMMANDS[name],
            description=description,
            epilog=examples,
            formatter_class=_format,
        )
        command.set_defaults(parser=command)
        return command

    commands.add_parser("play", help=COMMANDS["play"], add_help=False)
    _add_evaluate(add("evaluate", EVALUATE, EVALUATE_EXAMPLES))
    _add_leaderboard(add("leaderboard", LEADERBOARD, LEADERBOARD_EXAMPLES))
    bound = add("bound", BOUND, BOUND_EXAMPLES)
    bound.add_argument("searches", metavar="SEARCH", nargs="+", help=f"{SEARCH}, or all")
    _add_mission(bound)
    _add_work(bound)
    bound.add_argument("--json", action="store_true", help="print all values as JSON")
    _add_record(add("record", RECORD, RECORD_EXAMPLES))
    _add_export(add("export", EXPORT, EXPORT_EXAMPLES))
    return parser


def _add_evaluate(parser: argparse.ArgumentParser) -> None:
    parser.usage = "%(prog)s POLICY SEARCH [SEARCH ...] [options]"
    parser.add_argument(
        "policy",
        metavar="POLICY",
        nargs="?",
        help=f"a policy of this package, or {OWN_POLICY}",
    )
    parser.add_argument("searches", metavar="SEARCH", nargs="*", help=f"{SEARCH}, or all")
    _add_mission(parser)
    parser.add_argument("--list", action="store_true", help="list the policies and the searches")
    _add_posterior(parser, "the policy")
    parser.add_argument(
        "--bound", action="store_true", help="also show the upper bound, and the share reached"
    )
    _add_episodes(parser)
    _add_work(parser)
    output = parser.add_mutually_exclusive_group()
    output.add_argument("--json", action="store_true", help="print all estimates as JSON")
    output.add_argument("--csv", action="store_true", help="print the main estimates as CSV")


def _add_leaderboard(parser: argparse.ArgumentParser) -> None:
    parser.usage = "%(prog)s [options]"
    parser.add_argument("--searches", metavar="NAME", nargs="+", help=f"{SEARCH} (default: all)")
    parser.add_argument(
        "--policies", metavar="NAME", nargs="+", help=f"of {', '.join(POLICIES)} (default: all)"
    )
    parser.add_argument(
        "--add",
        metavar="POLICY",
        action="append",
        default=[],
        help=f"{OWN_POLICY}; may be repeated",
    )
    _add_posterior(parser, "your own policies")
    parser.add_argument(
        "--no-bound", dest="bound", action="store_false", help="leave the bounds out: much faster"
    )
    _add_episodes(parser)
    _add_work(parser)
    has_joblib = importlib.util.find_spec("joblib") is not None
    parser.set_defaults(out=Path("leaderboard"), workers=(os.cpu_count() or 1) if has_joblib else 1)


def _add_record(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("search", metavar="SEARCH", help=SEARCH)
    parser.add_argument(
        "--policy",
        metavar="POLICY",
        default="planner",
        help=f"of {', '.join(POLICIES)}, or {OWN_POLICY} (default: planner)",
    )
    parser.add_argument(
        "--seed", metavar="N", type=int, default=0, help="of the episode (default: 0)"
    )
    parser.add_argument("--out", metavar="FILE", required=True, help="the video, .gif or .mp4")
    parser.add_argument(
        "--fps", type=float, default=6.0, help="steps shown per second (default: 6)"
    )
    _add_posterior(parser, "the policy")


def _add_export(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("search", metavar="SEARCH", help=SEARCH)
    parser.add_argument(
        "--policies",
        metavar="POLICY",
        nargs="+",
        default=["planner"],
        help=f"of {', '.join(POLICIES)}, or {OWN_POLICY} (default: planner)",
    )
    parser.add_argument(
        "--seeds",
        metavar="N",
        nargs="+",
        type=int,
        default=[0],
        help="of the episodes (default: 0)",
    )
    parser.add_argument("--out", metavar="FILE", required=True, help="the file, .json")
    _add_posterior(parser, "the policies")


def _add_mission(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--mission", choices=MISSIONS, help="of all searches (default: that of each search)"
    )


def _add_posterior(parser: argparse.ArgumentParser, whom: str) -> None:
    text = f"show {whom} the posterior, not the prior"
    parser.add_argument("--posterior", action="store_true", help=text)


def _add_episodes(parser: argparse.ArgumentParser) -> None:
    """Add the options for the episodes and for what a policy sees."""
    parser.add_argument(
        "--episodes", metavar="N", type=int, default=2000, help="of each search (default: 2000)"
    )
    parser.add_argument(
        "--seed", metavar="S", type=int, default=0, help="of the first episode (default: 0)"
    )
    parser.add_argument(
        "--view", default="swarm", help="what your policy sees: swarm, drone or parallel (swarm)"
    )
    parser.add_argument(
        "--observation", default="dict", help=f"its layout: {', '.join(LAYOUTS)} (dict)"
    )
    parser.add_argument(
        "--action-mask", action="store_true", help="also show your policy masks of valid actions"
    )
    parser.add_argument(
        "--right-of-way", action="store_true", help="these masks prevent all collisions"
    )
    parser.add_argument(
        "--deterministic",
        action="store_true",
        default=None,
        help="your policy always acts alike after the same observations: exact success and time",
    )


def _add_work(parser: argparse.ArgumentParser) -> None:
    """Add the options of commands that take long."""
    parser.add_argument(
        "--workers",
        metavar="N",
        type=_count,
        default=1,
        help="processes; the results do not depend on them (default: %(default)s)",
    )
    parser.add_argument(
        "--ray",
        metavar="ADDRESS",
        nargs="?",
        const="local",
        help="run on Ray: on this machine, or on the cluster at ADDRESS",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        type=_folder,
        help="write the results to DIR, and resume from it",
    )


def _folder(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError("must name a folder, got ''")
    return Path(text)


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"must be an integer of at least 1, got {text!r:.100}")
    return int(text)
