"""A training run: its folder, its learning curve, and how far it has come."""

from __future__ import annotations

import argparse
import math
import shutil
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from types import TracebackType

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.files import replacing
from DroneSwarmSearch.evaluation.progress import Progress
from DroneSwarmSearch.training.curve import COLUMNS, Curve

__all__ = ["Run"]

INTERRUPTED = 130
"""The exit code after Ctrl-C, as shells have it."""


class Run:
    """A training run; a context manager, which shows the progress and draws the curve.

    Save a checkpoint before the first row of the curve, so that the run can be resumed from
    then on. After Ctrl-C the run says whether it can be, draws the curve, and ends the program
    with exit code 130.

    Args:
        options: as parsed by `arguments`.
        title: what is trained, in a few words.
        checkpoint: the name of the checkpoint, a file or folder in the run's folder; or a
            pattern, as ``Path.glob`` takes it, if the trainer chooses the names.

    Attributes:
        folder: where everything is kept.
        wanted: environment steps to train in all.
        steps_done: environment steps trained so far, those of a resumed run included.
        resumes: whether the run goes on from a checkpoint.

    Raises:
        SystemExit: the folder holds a run and ``--resume`` is not given, or the other way
            round.
    """

    def __init__(
        self, options: argparse.Namespace, title: str, checkpoint: str = "checkpoint.pt"
    ) -> None:
        self.folder: Path = options.out
        self.wanted: int = options.steps
        self.resumes: bool = options.resume
        self._title = title
        self._name = checkpoint
        self._file = self.folder / "curve.csv"
        self._restore_replaced_folder()
        newest = self._newest()
        if self.resumes and newest is None:
            raise SystemExit(
                f"there is nothing to resume in {self.folder}: no {checkpoint}; "
                f"{self._how_to_begin()}"
            )
        if not self.resumes and newest is not None:
            raise SystemExit(
                f"{self.folder} holds a run already: go on with it by --resume, or choose "
                "another folder with --out"
            )
        if not self.resumes and self._file.exists():
            raise SystemExit(
                f"{self.folder} holds a learning curve, but no {checkpoint} to resume from: "
                f"choose another folder with --out, or delete {self._file}"
            )
        self.folder.mkdir(parents=True, exist_ok=True)
        self._heard = False  # Ctrl-C
        self._curve = Curve(self._file)
        self._begin()

    def _begin(self) -> None:
        self.steps_done = self._curve.steps
        self._seconds_before = self._curve.seconds
        self._begun = time.monotonic()
        self._bar = Progress(self._title, self.wanted, done=self.steps_done)

    @property
    def curve(self) -> Curve:
        """The learning curve so far."""
        return self._curve

    @property
    def checkpoint(self) -> Path:
        """The newest checkpoint in the folder.

        Raises:
            FileNotFoundError: none has been saved yet.
        """
        newest = self._newest()
        if newest is None:
            raise FileNotFoundError(f"no checkpoint {self._name} in {self.folder}")
        return newest

    def saving(self, name: str) -> AbstractContextManager[Path]:
        """Save a file that is there as a whole or not at all, a checkpoint for example.

        For example::

            with run.saving("checkpoint.pt") as path:
                torch.save(model.state_dict(), path)

        Args:
            name: of the file in the folder; until the new one is complete, the old one stays.

        Returns:
            A context manager that hands out the path to write to.

        Raises:
            StorageError: the file cannot be put in its place. What is written into it raises
                errors of its own, of a full disk for example.
        """
        return replacing(self.folder / name)

    @contextmanager
    def saving_folder(self) -> Iterator[Path]:
        """Save a checkpoint that is a folder, and that is there as a whole or not at all.

        Yields:
            The path of the folder to write, absolute; it is not there yet. Until it is
            complete, the old checkpoint stays.

        Raises:
            OSError: it cannot be written.
        """
        place, old = self.folder / self._name, self._replaced_folder
        new = old.with_suffix(".new").absolute()
        shutil.rmtree(new, ignore_errors=True)
        try:
            yield new
            if place.exists():
                shutil.rmtree(old, ignore_errors=True)
                place.rename(old)
            new.rename(place)
        except BaseException:
            self._restore_replaced_folder()
            shutil.rmtree(new, ignore_errors=True)
            raise
        shutil.rmtree(old, ignore_errors=True)

    @property
    def _replaced_folder(self) -> Path:
        """Where the old checkpoint is while a new one takes its place."""
        return self.folder / f".{self._name.replace('/', '.')}.old"

    def _restore_replaced_folder(self) -> None:
        """Put the old checkpoint back if the program was ended before a new one was there."""
        old = self._replaced_folder
        if old.exists() and self._newest() is None:
            old.rename(self.folder / self._name)
        shutil.rmtree(old, ignore_errors=True)

    def _newest(self) -> Path | None:
        saved = self.folder.glob(self._name)
        return max(saved, key=lambda path: path.stat().st_mtime_ns, default=None)

    def _how_to_begin(self) -> str:
        """What to do where there is no checkpoint."""
        delete = f"delete {self._file} and " if self._file.exists() else ""
        return f"{delete}start without --resume"

    def go_on_from(self, steps: int) -> None:
        """Begin where the checkpoint was made: rows of the curve beyond it are dropped.

        Args:
            steps: environment steps that the checkpoint had been trained for.
        """
        self._curve.cut(checks.integer("steps", steps, 0))
        self._begin()
        self.steps_done = steps

    def log(
        self,
        steps: int,
        reward: float | None = None,
        found: float | None = None,
        **figures: float,
    ) -> None:
        """Add a row to the learning curve and show how far the run has come.

        Args:
            steps: environment steps so far, those of a resumed run included; more than in
                the row before.
            reward: the mean return of a drone in the episodes that ended since the row
                before, in the environment's own points; None (or NaN) if none ended.
            found: the share of them in which everybody was found; likewise.
            figures: the trainer's own, losses for example; a column each.

        Raises:
            KeyboardInterrupt: Ctrl-C was pressed, and a library swallowed it.
            StorageError: curve.csv cannot be written.
            ValueError: `steps` is not more than before, or a figure has a column's name.
        """
        steps = checks.integer("steps", steps, self._curve.steps + 1)
        taken = [name for name in figures if name in COLUMNS]
        if taken:
            raise ValueError(f"figures must have names other than {', '.join(COLUMNS)}")
        self._curve.append(
            {
                "steps": steps,
                "seconds": round(self._seconds_before + time.monotonic() - self._begun, 2),
                "reward": math.nan if reward is None else float(reward),
                "found": math.nan if found is None else float(found),
                **figures,
            }
        )
        self.steps_done = steps
        self._bar(steps, self._latest())
        if self._heard:
            raise KeyboardInterrupt

    def draw(self) -> None:
        """Draw curve.png; without matplotlib, say what is missing."""
        if not self._curve.rows:
            return
        try:
            self._curve.draw(self.folder / "curve.png", self._title)
        except ImportError as error:
            print(error, file=sys.stderr)

    def _latest(self) -> str:
        """The latest known figures in words."""
        words = []
        for name, form in (("found", "{:.0%} found"), ("reward", "return {:,.0f}")):
            known = [row[name] for row in self._curve.rows[-20:] if not math.isnan(row[name])]
            words += [form.format(known[-1])] if known else []
        return ", ".join(words)

    def __enter__(self) -> Run:
        here = threading.current_thread() is threading.main_thread()
        if here and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, self._hear)
        return self

    def _hear(self, *_: object) -> None:
        """Note Ctrl-C: code of libraries that cannot raise, a callback from C, swallows it."""
        self._heard = True
        raise KeyboardInterrupt

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if signal.getsignal(signal.SIGINT) == self._hear:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        self._bar.__exit__(kind, error, trace)
        interrupted = _comes_of_an_interrupt(error)
        if not interrupted:
            try:
                self.draw()
                return
            except KeyboardInterrupt:
                pass
        newest = self._newest()
        if newest is None:
            told = (
                f"interrupted before the first checkpoint: there is nothing to resume in "
                f"{self.folder}; {self._how_to_begin()}"
            )
        else:
            told = (
                f"interrupted after {self.steps_done:,} steps; --resume goes on from the last "
                f"checkpoint, {newest}"
            )
        print(told, file=sys.stderr, flush=True)
        if interrupted:
            with suppress(KeyboardInterrupt):
                self.draw()
        raise SystemExit(INTERRUPTED) from None


def _comes_of_an_interrupt(error: BaseException | None) -> bool:
    """Whether an error is Ctrl-C's, or arose while a library was dealing with that."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None
