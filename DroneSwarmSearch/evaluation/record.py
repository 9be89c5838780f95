"""Films of one search: what the drift alone says, and beside it what the searches leave of it.

Two environments with the same seed and the same actions go through the same search: for
one seed the sea does not depend on whether the matrix is a prior or a posterior. So the
two boards of a picture show the same drones and the same persons, over two beliefs.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.env import DroneSwarmSearch
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.progress import Progress
from DroneSwarmSearch.evaluation.suite import NamedSearch, as_named
from DroneSwarmSearch.evaluation.workers import no_exit
from DroneSwarmSearch.policies import POLICIES
from DroneSwarmSearch.rendering.film import SUFFIXES, write_film
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rendering.labels import outcome_in_brief

__all__ = ["frames", "main", "record"]

FPS = 6.0
FPS_LEAST, FPS_MOST = 0.1, 50.0
"""Steps shown per second; the most is what a GIF can do."""

HOLD = 3.0
"""Seconds for which the last picture stays."""

GIF_WIDTH = 1000
"""Pixels across, at most: two boards side by side need more than one does."""

EXAMPLES = """\
examples:
  python -m DroneSwarmSearch record classic --policy greedy-posterior --out classic.gif
  python -m DroneSwarmSearch record fog --policy parallel-sweep --seed 7 --out fog.mp4

The film shows the very episode that `evaluate` plays with that seed. On the left is where
the drift takes the persons, whatever was searched; on the right the exact posterior given
the searches made. Colours run from 0 to the likeliest cell of each board.
"""


def record(
    policy: object,
    search: object,
    path: str | os.PathLike[str],
    *,
    seed: int = 0,
    name: str | None = None,
    bayesian_update: bool | None = None,
    fps: float = FPS,
) -> Frame:
    """Film one episode: the prior on the left, the posterior on the right.

    The file appears when the film is finished; what it held before stays until then.

    Args:
        policy: as for `evaluate`; a callable is shown one search, in PettingZoo's form.
        search: a name of the suite, a `NamedSearch`, or a `Scenario`.
        path: the file, .gif or .mp4.
        seed: of the episode, an integer >= 0.
        name: the policy's name in the picture; without it, the one that it has.
        bayesian_update: whether the policy is shown the posterior or the prior; without
            it, what the search says.
        fps: steps shown per second, from 0.1 to 50.

    Returns:
        The last frame of the episode, with the posterior as its matrix.

    Raises:
        ImportError: a package of the extra "video" is missing, or its ffmpeg.
        OSError: the file cannot be written.
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of its limits, or a name unknown.
    """
    from DroneSwarmSearch.rendering.side_by_side import SideBySide

    target = Path(path)
    if target.suffix.lower() not in SUFFIXES:
        raise ValueError(f"path must end in {' or '.join(SUFFIXES)}, got {str(path)!r}")
    rate = checks.real("fps", fps, FPS_LEAST, FPS_MOST)
    spec, where = PolicySpec.of(policy, name), as_named(search)
    pairs = frames(spec, where, seed=seed, bayesian_update=bayesian_update)
    title = f"{spec.name} searching {where.name}, seed {seed}"
    side_by_side = SideBySide(where.scenario.grid_size, title)
    last: list[Frame] = []

    def pictures() -> Iterator[NDArray[np.uint8]]:
        for prior, posterior in pairs:
            last[:] = [posterior]
            bar(posterior.step)
            yield side_by_side.pixels(prior, posterior)

    limit = where.scenario.timestep_limit
    with Progress(f"film of {title}", limit) as bar:
        write_film(target, pictures(), fps=rate, hold=HOLD, gif_width=GIF_WIDTH)
    return last[0]


def frames(
    policy: object,
    search: object,
    *,
    seed: int = 0,
    bayesian_update: bool | None = None,
) -> Iterator[tuple[Frame, Frame]]:
    """One episode, step by step, as two environments show it.

    Args:
        policy: as in `record`, like the others.
        search: the same.
        seed: of the episode.
        bayesian_update: whether the policy is shown the posterior.

    Returns:
        An iterator over the steps, the state that `reset` returns being the first: the
        frame with the prior as its matrix, and the same with the posterior.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of its limits, or a name unknown.
    """
    where = as_named(search)
    scenario = where.scenario
    first = checks.integer("seed", seed, 0)
    if bayesian_update is None:
        bayesian_update = scenario.bayesian_update
    else:
        bayesian_update = checks.boolean("bayesian_update", bayesian_update)
    with no_exit(f"the policy on {where.name}"):
        steer = PolicySpec.of(policy).make(scenario)
    return _played(steer, where, first, bayesian_update)


def _played(
    steer: Callable[..., Any], search: NamedSearch, seed: int, bayesian_update: bool
) -> Iterator[tuple[Frame, Frame]]:
    with no_exit(f"the policy on {search.name}"):
        prior, posterior = (_environment(search, updates) for updates in (False, True))
        shown = [env.reset(seed, drones_positions=search.drones)[0] for env in (prior, posterior)]
        forget = getattr(steer, "reset", None)
        if forget is not None:
            forget(seed=seed)
        yield prior.frame(), posterior.frame()
        while prior.agents:
            actions = steer(shown[bayesian_update])
            shown = [env.step(actions)[0] for env in (prior, posterior)]
            yield prior.frame(), posterior.frame()


def _environment(search: NamedSearch, bayesian_update: bool) -> DroneSwarmSearch:
    parameters = search.with_posterior(bayesian_update).parameters
    del parameters["drones_positions"]
    return DroneSwarmSearch(render_mode=None, **parameters)


# The command line.


def main(argv: Sequence[str] | None = None) -> int:
    """Run `python -m DroneSwarmSearch record`.

    Args:
        argv: the arguments after the command's name; those of the process if None.

    Returns:
        The exit code: 0, or 130 after Ctrl-C.

    Raises:
        SystemExit: help was asked for (code 0), or the film cannot be made (code 2).
    """
    parser = _parser()
    options = parser.parse_args(argv)
    try:
        last = record(
            options.policy,
            options.search,
            options.out,
            seed=options.seed,
            bayesian_update=True if options.posterior else None,
            fps=options.fps,
        )
    except KeyboardInterrupt:
        print("\ninterrupted: no film was written", file=sys.stderr)
        return 130
    except ImportError as error:
        _give_up(parser, str(error))
    except OSError as error:
        _give_up(parser, f"cannot write {options.out}: {error.strerror or error}")
    except (TypeError, ValueError) as error:
        _give_up(parser, str(error))
    print(f"{options.out}: {options.policy} searching {options.search}, {outcome_in_brief(last)}")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m DroneSwarmSearch record",
        description="Film one search of the suite: the prior on the left, the posterior on"
        " the right, the same drones and persons on both.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("search", metavar="SEARCH", help="a search of the suite")
    parser.add_argument(
        "--policy",
        metavar="NAME",
        default="planner",
        help=f"one of {', '.join(POLICIES)}, or weights.npz, module:attribute or"
        " file.py:attribute for one of your own; the code of a module or file is executed"
        " (default: planner)",
    )
    parser.add_argument(
        "--seed", metavar="N", type=int, default=0, help="another seed, another drift (default: 0)"
    )
    parser.add_argument(
        "--out", metavar="FILE", required=True, help="the film to write, .gif or .mp4"
    )
    parser.add_argument(
        "--fps", type=float, default=FPS, help=f"steps shown per second (default: {FPS:g})"
    )
    parser.add_argument(
        "--posterior",
        action="store_true",
        help="show the policy the posterior in place of what the search shows",
    )
    return parser


def _give_up(parser: argparse.ArgumentParser, message: str) -> NoReturn:
    parser.exit(2, f"{parser.prog}: error: {message}\n")
    raise AssertionError("unreachable: the parser exits")
