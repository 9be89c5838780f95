"""`python -m DroneSwarmSearch`: the demo in the terminal, or the benchmark."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from DroneSwarmSearch import demo

HELP = """\
usage: python -m DroneSwarmSearch [play] [options]
       python -m DroneSwarmSearch bench [options]

commands:
  play   watch a search in the terminal; this is what happens without a command
  bench  measure speed, as ratios taken in turns, and memory

`python -m DroneSwarmSearch play --help` and `... bench --help` tell the options of each.
"""


def main(argv: Sequence[str]) -> int:
    """Run a command.

    Args:
        argv: the command line's arguments.

    Returns:
        The exit code.

    Raises:
        SystemExit: help was asked for (code 0), or an option cannot be met (code 2).
    """
    command, *rest = argv or ("play",)
    if command in ("-h", "--help"):
        print(HELP, end="")
        return 0
    if command == "bench":
        from DroneSwarmSearch import bench

        return bench.main(rest)
    return demo.main(["--text", *(rest if command == "play" else argv)])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
