"""A training run: its folder with checkpoints, its learning curve and its progress."""

from __future__ import annotations

import argparse
import math
import shutil
import signal
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from types import TracebackType

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.files import StorageError, check_writable, replacing
from DroneSwarmSearch._internal.progress import Progress
from DroneSwarmSearch.training.curve import COLUMNS, HELD_OUT, Curve
from DroneSwarmSearch.training.interrupts import INTERRUPTED, handle_interrupts

__all__ = ["Run"]


class Run:
    """A training run; a context manager that shows the progress and plots the learning curve.

    Save a checkpoint before you log the first row, so that the run can be resumed at any
    time. After Ctrl-C, the run reports whether it can be resumed, plots the curve, and exits
    the program with code 130.

    Args:
        options: the options parsed by the parser of `arguments`.
        title: the title of the plot and the progress bar.
        checkpoint: name of the checkpoint, a file or folder in the run's folder; or a pattern for
            ``Path.glob``, whose newest match counts.

    Attributes:
        folder: the run's folder.
        total_steps: environment steps to train, including those before a resume.
        steps_done: environment steps trained so far, including those before a resume.
        resuming: whether the run continues from a checkpoint: ``--resume`` is given, and the
            folder holds one.
        checkpoint_name: the argument `checkpoint`.

    Raises:
        SystemExit: the folder holds a run but ``--resume`` is not given, or a learning curve
            without a checkpoint, or cannot be written.
    """

    def __init__(
        self, options: argparse.Namespace, title: str, checkpoint: str = "checkpoint.pt"
    ) -> None:
        self.folder: Path = options.out
        self.total_steps: int = options.steps
        self._title = title
        self.checkpoint_name = checkpoint
        self._file = self.folder / "curve.csv"
        newest = self._newest()
        self.resuming: bool = options.resume and newest is not None
        if not self.resuming and newest is not None:
            raise SystemExit(
                f"{self.folder} already holds a run: continue it with --resume, or choose "
                "another folder with --out"
            )
        if not self.resuming and self._file.exists():
            raise SystemExit(
                f"{self.folder} holds a learning curve, but no {checkpoint} to resume from: "
                f"choose another folder with --out, or delete {self._file}"
            )
        if options.resume and not self.resuming:
            message = f"nothing to resume in {self.folder}: the training starts from the beginning"
            print(message, file=sys.stderr)
        try:
            check_writable(self._file)
        except StorageError as error:
            raise SystemExit(f"cannot write to {self.folder}: {error.strerror}") from None
        self._interrupted = False
        self._curve = Curve(self._file)
        self._start()

    def _start(self) -> None:
        self.steps_done = self._curve.steps
        self._seconds_before = self._curve.seconds
        self._started = time.monotonic()
        self._bar = Progress(self._title, self.total_steps, done=self.steps_done)

    @property
    def checkpoint(self) -> Path:
        """The newest checkpoint in the folder.

        Raises:
            FileNotFoundError: there is none yet.
        """
        newest = self._newest()
        if newest is None:
            raise FileNotFoundError(f"no checkpoint {self.checkpoint_name} in {self.folder}")
        return newest

    def saving(self, name: str) -> AbstractContextManager[Path]:
        """Save a file atomically: until the new file is complete, the old one stays.

        For example::

            with run.saving("checkpoint.pt") as path:
                torch.save(model.state_dict(), path)

        Args:
            name: the file's name in the folder.

        Returns:
            A context manager that yields the path to write to.

        Raises:
            StorageError: the file cannot be moved into place.
        """
        return replacing(self.folder / name)

    @contextmanager
    def saving_folder(self, name: str) -> Iterator[Path]:
        """Save a checkpoint that is a folder; once it is complete, earlier ones are deleted.

        Args:
            name: the new checkpoint's name; it matches the run's pattern and does not exist yet.

        Yields:
            The absolute path of the folder to create.

        Raises:
            OSError: it cannot be written.
        """
        new = self.folder.absolute() / ".new"
        shutil.rmtree(new, ignore_errors=True)
        earlier = list(self.folder.glob(self.checkpoint_name))
        try:
            yield new
            new.rename(self.folder / name)
        except BaseException:
            shutil.rmtree(new, ignore_errors=True)
            raise
        for path in earlier:
            shutil.rmtree(path, ignore_errors=True)

    def _newest(self) -> Path | None:
        saved = self.folder.glob(self.checkpoint_name)
        return max(saved, key=lambda path: path.stat().st_mtime_ns, default=None)

    def resume_from(self, steps: int) -> None:
        """Continue from a checkpoint; later rows of the curve are removed.

        Args:
            steps: environment steps at the checkpoint.
        """
        self._curve.cut(checks.integer("steps", steps, 0))
        self._start()
        self.steps_done = steps

    def log(
        self,
        steps: int,
        reward: float | None = None,
        found: float | None = None,
        held_out: Mapping[str, float] | None = None,
        **values: float,
    ) -> None:
        """Add a row to the learning curve, and show the progress.

        Args:
            steps: environment steps so far, including those before a resume; more than in
                the previous row.
            reward: mean return of a drone over the episodes that ended since the previous
                row, in unscaled points; None or NaN if none ended.
            found: fraction of these episodes in which all persons were found, or in the coverage
                mission their mean probability of success; None or NaN if none ended.
            held_out: success rates on searches outside the training, by the policy's name: the
                policy in training first, then baselines. The plot shows them.
            values: further values, such as losses; one column each.

        Raises:
            KeyboardInterrupt: Ctrl-C was pressed, and a library suppressed it.
            StorageError: curve.csv cannot be written.
            ValueError: `steps` has not increased, or a value has the name of a column above.
        """
        steps = checks.integer("steps", steps, self._curve.steps + 1)
        if not values.keys().isdisjoint(COLUMNS):
            raise ValueError(f"values must have names other than {', '.join(COLUMNS)}")
        self._curve.append(
            {
                "steps": steps,
                "seconds": round(self._seconds_before + time.monotonic() - self._started, 2),
                "reward": math.nan if reward is None else float(reward),
                "found": math.nan if found is None else float(found),
                **{HELD_OUT + name: float(each) for name, each in (held_out or {}).items()},
                **values,
            }
        )
        self.steps_done = steps
        self._bar(steps, self._latest())
        if self._interrupted:
            raise KeyboardInterrupt

    def _latest(self) -> str:
        """The latest known values, for the progress bar."""
        parts = []
        for name in ("found", "reward"):
            known = [row[name] for row in self._curve.rows[-20:] if not math.isnan(row[name])]
            if known and name == "found":
                parts.append(f"{known[-1]:.0%} found")
            elif known:  # at most 1 in the coverage mission
                parts.append(f"return {known[-1]:,.{0 if abs(known[-1]) >= 10 else 2}f}")
        return ", ".join(parts)

    def _draw(self) -> None:
        """Plot curve.png; without matplotlib, report that it is missing."""
        if not self._curve.rows:
            return
        try:
            self._curve.draw(self.folder / "curve.png", self._title)
        except ImportError as error:
            print(error, file=sys.stderr)

    def __enter__(self) -> Run:
        handle_interrupts(self._on_interrupt)
        return self

    def _on_interrupt(self, *_: object) -> None:
        """Remember Ctrl-C: callbacks from C code suppress the exception."""
        self._interrupted = True
        raise KeyboardInterrupt

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if signal.getsignal(signal.SIGINT) == self._on_interrupt:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        self._bar.__exit__(kind, error, trace)
        interrupted = _caused_by_interrupt(error)
        if not interrupted:
            try:
                self._draw()
                return
            except KeyboardInterrupt:
                pass
        newest = self._newest()
        if newest is None:
            message = (
                f"interrupted before the first checkpoint: there is nothing to resume in "
                f"{self.folder}; start again"
            )
        else:
            message = (
                f"interrupted after {self.steps_done:,} steps; --resume continues from the last "
                f"checkpoint, {newest}"
            )
        print(message, file=sys.stderr, flush=True)
        if interrupted:
            with suppress(KeyboardInterrupt):
                self._draw()
        raise SystemExit(INTERRUPTED) from None


def _caused_by_interrupt(error: BaseException | None) -> bool:
    """Whether an error is a KeyboardInterrupt, or was raised while one was handled."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None
