"""Modules of optional packages."""

from __future__ import annotations

import contextlib
import importlib
import os
from collections.abc import Iterator
from typing import Any


def needed(module: str, reason: str, extra: str) -> Any:
    """A module; ImportError says which extra installs what it needs."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ImportError(_hint(reason, extra)) from error


@contextlib.contextmanager
def imports_of(extra: str) -> Iterator[None]:
    """Around the imports of optional packages; ImportError says which extra installs them."""
    try:
        yield
    except ImportError as error:
        raise type(error)(_hint(error, extra), name=error.name) from error


def _hint(reason: object, extra: str) -> str:
    """A reason, and the command that installs an extra."""
    return f'{reason}: pip install "DroneSwarmSearchEnvironment[{extra}]"'


def import_matplotlib(reason: str, extra: str) -> None:
    """Import Matplotlib, or raise an ImportError as `needed` does.

    Figures of this package use no backend of pyplot. But Matplotlib refuses to be imported if the
    environment's MPLBACKEND names one that is missing, as Jupyter's often is in other environments.
    The setting is kept for the caller's own plots.
    """
    backend = os.environ.pop("MPLBACKEND", None)
    try:
        matplotlib = needed("matplotlib", reason, extra)
        if backend:
            with contextlib.suppress(ValueError):
                matplotlib.rcParams["backend"] = backend
    finally:
        if backend is not None:
            os.environ["MPLBACKEND"] = backend
