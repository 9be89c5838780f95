"""The command line: `python -m DroneSwarmSearch` and `droneswarmsearch`."""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import io
import os
import re
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from DroneSwarmSearch import __version__
from DroneSwarmSearch.commands import evaluation, plan, play
from DroneSwarmSearch.commands.options import add_parser
from DroneSwarmSearch.core.scenario import MISSIONS
from DroneSwarmSearch.policies import POLICIES
from DroneSwarmSearch.rendering.palette import PALETTES

PROGRAM = "python -m DroneSwarmSearch"

NEGATIVE = re.compile(r"-\.?\d")  # what negative numbers begin with, and no option does

# A summary, a description and examples of each.
COMMANDS = {
    "play": """\
watch a search in a window or in the terminal, or fly a drone; the default

Drones search the sea for shipwrecked persons who drift: watch a policy, or fly
one drone yourself. Without SEARCH, drones look for a passenger who fell from a
ferry ("man-overboard"). The policy is "greedy-forecast", unless you name one:
each drone flies to a near cell where the person is likely to be by then.

examples:
  droneswarmsearch play                         watch a search
  droneswarmsearch play --manual --hide-person  fly drone 0 against the policies
  droneswarmsearch play gale --policy planner --seed 4
  droneswarmsearch play classic --record classic.gif

The window lists the keys. With --manual, the arrow keys (or W, A, S, D) move
drone 0, space searches, and I waits; every key is one step for all drones.
With --hide-person, you see no more than the policies do, and your result is
compared with theirs at the end.
""",
    "plan": """\
plan flights for an incident: waypoints, files for maps, a printed map

Plan where drones fly to find somebody who drifts at sea. The folder holds a
mission for each drone's autopilot; the plan as GPX, KML, GeoJSON and CSV; a map
to print; and incident.json, to run it again.

examples:
  droneswarmsearch plan --position 54.18 7.85 --time 2026-03-01T05:30Z \\
      --object LIFE-RAFT-SB-6 --wind 300 25kn --current 160 0.5kn --out plan
  droneswarmsearch plan --incident plan/incident.json --drones 4 --out more
  droneswarmsearch plan --after plan --out second
""",
    "evaluate": """\
evaluate a policy on searches of the suite

Success is the share of episodes in which every person is found by the time
limit; time is the restricted mean time to find (failures count with the limit);
return is the mean return of the team; crashes are episodes in which drones
collided or left the grid. Coverage missions are judged by the probability of
success (POS) of the searches made; coverage and repetition are the different
cells searched and the repeated searches, both divided by the number of cells.

examples:
  droneswarmsearch evaluate --list
  droneswarmsearch evaluate greedy-posterior classic man-overboard --bound
  droneswarmsearch evaluate planner all --workers 2 --out results

The file or module of your own policy is executed: only name code that you
trust. The guide "Evaluation" of the documentation explains policies, and the
files of searches.
""",
    "leaderboard": """\
compare all policies on the suite: tables, plots, files

Evaluate every policy on every search, in the same episodes; print tables, and
write leaderboard.csv and plots to DIR (default: leaderboard).

examples:
  droneswarmsearch leaderboard
  droneswarmsearch leaderboard --episodes 200 --searches pond fog --workers 2
  droneswarmsearch leaderboard --add my_policies.py:MyPolicy --out mine
""",
    "bound": """\
compute upper bounds on the success of any policy

Compute a certified upper bound on the probability that any policy finds every
person, within the time limit and within each earlier step. In a coverage
mission it is a bound on the probability of success (POS) of any searches.

examples:
  droneswarmsearch bound pond harbour
  droneswarmsearch bound all --workers 2 --out bounds
""",
    "record": """\
record a video of a search

Record a video of the episode that `evaluate` plays with the same seed. The map
shows the posterior, which the unsuccessful searches have changed.

examples:
  droneswarmsearch record classic --policy greedy-posterior --out classic.gif
  droneswarmsearch record fog --policy parallel-sweep --seed 7 --out fog.mp4
""",
    "export": """\
write episodes of a search as JSON, to play them in a browser

Write the episodes of some policies on a search as JSON: actions, persons,
probability of success, returns, prior and posterior of every step. The page
"Watch searches" of the documentation plays such files; `evaluation.export`
documents their format.

examples:
  droneswarmsearch export harbour --policies imitation --out harbour.json
  droneswarmsearch export fog --policies mine.py:MyPolicy planner --out fog.json
""",
}

OWN_POLICY = "your own: file.py:Class or file.py:Class:argument, whose code is executed"

FORMAT: Any = partial(argparse.RawDescriptionHelpFormatter, max_help_position=28)
SEARCH = "of the suite, or a file of a search, .json"


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command with the arguments, by default those of the process; returns the exit code.

    Raises SystemExit for help (code 0) or if an argument is wrong (code 2).
    """
    if argv is None:
        argv = sys.argv[1:]
        if isinstance(sys.stdout, io.TextIOWrapper):
            # An ASCII terminal shows "?" for missing characters, instead of failing.
            sys.stdout.reconfigure(errors="replace")
    if not argv or (argv[0].startswith("-") and argv[0] not in ("-h", "--help", "--version")):
        argv = ["play", *argv]
    # A text that begins with a space is no option, and -33.9,18.4 is a position.
    argv = [f" {text}" if NEGATIVE.match(text) else text for text in argv]
    with _open_streams():
        return _run(_parser().parse_args(argv))


@contextlib.contextmanager
def _open_streams() -> Iterator[None]:
    """Let a closed standard output or standard error go where the other one goes."""
    stdout = sys.stdout
    stderr = sys.stderr
    if stdout is not None and stderr is not None:
        yield
        return
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        sys.stdout = stdout or stderr or nowhere
        sys.stderr = stderr or stdout or nowhere
        try:
            yield
        finally:
            sys.stdout = stdout
            sys.stderr = stderr


def _run(options: argparse.Namespace) -> int:
    """Run a command; returns the exit code, which is not 0 if its output cannot be written."""
    code = evaluation.run(options)
    try:
        sys.stdout.flush()
    except OSError as error:
        # Python must not fail again when it flushes the rest.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if code == 0 and not isinstance(error, BrokenPipeError):
            print(f"cannot write the output: {error.strerror}", file=sys.stderr)
        return code or 1
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=PROGRAM,
        formatter_class=FORMAT,
        usage=f"{PROGRAM} [play [SEARCH]] [options]\n       {PROGRAM} COMMAND [arguments]",
        epilog=f"`{PROGRAM} COMMAND --help` describes the options of each.",
    )
    parser.add_argument("--version", action="version", version=f"DroneSwarmSearch {__version__}")
    several = parser.add_subparsers(title="commands", metavar="COMMAND", prog=PROGRAM)
    for name, text in COMMANDS.items():
        summary, description, more = text.split("\n\n", 2)
        command = add_parser(
            several,
            name,
            help=summary,
            description=description,
            epilog=more,
            formatter_class=FORMAT,
        )
        command.set_defaults(parser=command, function=getattr(evaluation, name, None))
        if name in ("play", "plan"):
            module = play if name == "play" else plan
            module.add_arguments(command)
            command.set_defaults(function=module.run)
        elif name in ("record", "export"):
            _add_files(command, name)
        else:
            _add_results(command, name)
    return parser


def _add_files(parser: argparse.ArgumentParser, name: str) -> None:
    parser.usage = "%(prog)s SEARCH --out FILE [options]"
    parser.set_defaults(names={"search": "SEARCH", "path": "--out"})
    add = parser.add_argument
    add("search", metavar="SEARCH", help=SEARCH)
    policies = f"of {', '.join(POLICIES)}, or {OWN_POLICY} (default: planner)"
    if name == "record":
        add("--policy", metavar="POLICY", default="planner", help=policies)
        add("--seed", metavar="N", type=int, default=0, help="of the episode (default: 0)")
        add("--fps", type=float, default=6.0, help="steps shown per second (default: 6)")
        add("--drone", metavar="K", type=int, help="show what drone K knows, with radios")
        colours = "the map's colours (default: sea)"
        add("--palette", choices=PALETTES, default="sea", help=colours)
    else:
        add("--policies", metavar="POLICY", nargs="+", default=["planner"], help=policies)
        add("--seeds", metavar="N", nargs="+", type=int, default=[0], help="(default: 0)")
    kind = "the video, .gif or .mp4" if name == "record" else "the file, .json"
    add("--out", metavar="FILE", required=True, help=kind)
    evaluation.add_view(parser)


def _add_results(parser: argparse.ArgumentParser, name: str) -> None:
    add = parser.add_argument
    if name == "leaderboard":
        parser.usage = "%(prog)s [options]"
        parser.set_defaults(names={"search": "--searches"})
        searches = f"{SEARCH} (default: all)"
        add("--searches", metavar="NAME", nargs="+", default=["all"], help=searches)
        add("--policies", metavar="NAME", nargs="+", help=f"of {', '.join(POLICIES)}; default: all")
        own = f"{OWN_POLICY}; may be repeated"
        add("--add", metavar="POLICY", action="append", default=[], help=own)
        rows = "a .csv file of policies with the success that they claim, which must come out"
        add("--submissions", metavar="FILE", type=Path, help=rows)
        add("--no-bound", dest="bound", action="store_false", help="without bounds: much faster")
    else:
        names = {"policy": "POLICY", "search": "SEARCH", "searches": "SEARCH"}
        parser.set_defaults(names=names)
        if name == "evaluate":
            parser.usage = "%(prog)s POLICY SEARCH [SEARCH ...] [options]"
            own = f"a policy of this package, or {OWN_POLICY}"
            parser.set_defaults(policies=[], submissions=None)
            add("policy", metavar="POLICY", nargs="?", help=own)
            add("--list", action="store_true", help="list the policies and the searches")
            add("--csv", action="store_true", help="print the estimates as CSV")
            add("--bound", action="store_true", help="also show the bound, and the share of it")
        count = "+" if name == "bound" else "*"
        add("searches", metavar="SEARCH", nargs=count, help=f"{SEARCH}, or all")
        add("--mission", choices=MISSIONS, help="of all searches (default: each search's own)")
    if name != "bound":
        add("--episodes", metavar="N", type=int, default=2000, help="per search (default: 2000)")
        add("--seed", metavar="S", type=int, default=0, help="of the first episode (default: 0)")
        evaluation.add_view(parser)
        alike = "it always acts alike after the same observations: exact success and time"
        add("--deterministic", action="store_true", default=None, help=alike)
    has_joblib = importlib.util.find_spec("joblib") is not None
    workers = (os.cpu_count() or 1) if name == "leaderboard" and has_joblib else 1
    text = "processes; the results do not depend on them (default: %(default)s)"
    add("--workers", metavar="N", type=int, default=workers, help=text)
    ray = "run on Ray: on this machine, or on the cluster at ADDRESS"
    add("--ray", metavar="ADDRESS", nargs="?", const="local", help=ray)
    folder = Path("leaderboard") if name == "leaderboard" else None
    out = "write the results to DIR, and resume from it after an interruption"
    add("--out", metavar="DIR", type=Path, default=folder, help=out)
