"""`python -m DroneSwarmSearch`: the commands, each with its own options."""

from __future__ import annotations

import difflib
import importlib
import io
import sys
from collections.abc import Callable, Sequence

from DroneSwarmSearch import demo

HELP = """\
usage: python -m DroneSwarmSearch [play] [options]
       python -m DroneSwarmSearch COMMAND [arguments]

commands:
  play         watch a search, in a window if there is a display, else in the terminal;
               this is what happens without a command
  evaluate     let a policy play searches of the suite, and tell how well it did
  leaderboard  compare all policies on the suite: tables, plots, files
  bound        what no policy can exceed on a search
  record       a film of one search, belief beside prior
  bench        measure speed, as ratios taken in turns, and memory

`python -m DroneSwarmSearch COMMAND --help` tells the options of each, with examples.
"""

COMMANDS = {
    "evaluate": ("DroneSwarmSearch.evaluation.cli", "evaluate_main"),
    "leaderboard": ("DroneSwarmSearch.evaluation.leaderboard", "main"),
    "bound": ("DroneSwarmSearch.evaluation.cli", "bound_main"),
    "record": ("DroneSwarmSearch.evaluation.record", "main"),
    "bench": ("DroneSwarmSearch.bench", "main"),
}
"""Where each command is; imported when it is called."""


def main(argv: Sequence[str]) -> int:
    """Run a command.

    Args:
        argv: the command line's arguments.

    Returns:
        The exit code.

    Raises:
        SystemExit: help was asked for (code 0), or an argument cannot be met (code 2).
    """
    command, *rest = argv or ("play",)
    if command in ("-h", "--help"):
        print(HELP, end="")
        return 0
    if command in COMMANDS:
        module, name = COMMANDS[command]
        run: Callable[[Sequence[str]], int] = getattr(importlib.import_module(module), name)
        return run(rest)
    if command != "play" and not command.startswith("-"):
        near = difflib.get_close_matches(command, ["play", *COMMANDS])
        meant = f"; did you mean {' or '.join(near)}?" if near else ""
        print(f"no such command: {command!r}{meant}\n\n{HELP}", end="", file=sys.stderr)
        return 2
    return demo.main(rest if command == "play" else argv)


if __name__ == "__main__":
    if isinstance(sys.stdout, io.TextIOWrapper):
        # Characters that an ASCII terminal lacks appear as "?", as on stderr they are escaped.
        sys.stdout.reconfigure(errors="replace")
    sys.exit(main(sys.argv[1:]))
