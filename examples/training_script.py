"""What training scripts begin and end with: their options and folder; comparison and curve."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from DroneSwarmSearch.training import TRAINING_TASK, Task, compare_with_baselines, plot_curve


def begin(
    description: str,
    checkpoints: str = "",
    /,
    **options: Mapping[str, Any],
) -> argparse.Namespace:
    """Read the options of a training script, and create its folder.

    All scripts have `out`, a folder that must be new; `seed`; `threads`; `episodes`, of the
    comparison; and `no_comparison`.

    Args:
        description: of the script, for ``--help``.
        checkpoints: a pattern of files in the folder from which `resume`, an option then, goes on.
        options: more of them, as the arguments of ``ArgumentParser.add_argument`` by name.
    """
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    add = parser.add_argument
    add("--out", type=Path, required=True, help="folder of the training")
    if checkpoints:
        add("--resume", action="store_true", help="continue from its last checkpoint")
    for name, arguments in options.items():
        add(f"--{name.replace('_', '-')}", **arguments)
    add("--seed", type=int, default=0, help="of all random numbers")
    add("--threads", type=int, default=1, help="of PyTorch; more rarely help")
    add("--episodes", type=int, default=1000, help="of the comparison")
    add("--no-comparison", action="store_true", help="only train")
    parsed = parser.parse_args()
    if checkpoints and parsed.resume != any(parsed.out.glob(checkpoints)):
        parser.error(f"{parsed.out} holds {'no' if parsed.resume else 'a'} training to resume")
    if not checkpoints and parsed.out.exists():
        parser.error(f"{parsed.out} exists: choose another folder")
    parsed.out.mkdir(parents=True, exist_ok=True)
    return parsed


def finish(
    policy: object,
    name: str,
    options: argparse.Namespace,
    *curves: Path,
    task: Task | None = None,
    **plot: Any,
) -> None:
    """Compare a trained policy with the baselines on a task, and plot its curve; or neither.

    Args:
        policy: as for `evaluation.evaluate`.
        name: the policy's name in tables.
        options: those of `begin`.
        curves: the files of learning curves; by default curve.csv in the folder.
        task: of the benchmark, or by default `TRAINING_TASK`.
        plot: more arguments of `plot_curve`.
    """
    if options.no_comparison:
        return
    task = task or Task(TRAINING_TASK)
    _, *baselines = compare_with_baselines(
        policy,
        task if task.sampler else task.parameters,
        episodes=options.episodes,
        name=name,
        folder=options.out,
    )
    plot_curve(*(curves or [options.out / "curve.csv"]), baselines=baselines, **plot)
