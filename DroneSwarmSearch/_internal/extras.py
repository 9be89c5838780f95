"""Modules of optional packages."""

from __future__ import annotations

import importlib
from typing import Any


def needed(module: str, reason: str, extra: str) -> Any:
    """A module; ImportError says which extra installs what it needs."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        hint = f'{reason}: pip install "DroneSwarmSearchEnvironment[{extra}]"'
        raise ImportError(hint) from error
