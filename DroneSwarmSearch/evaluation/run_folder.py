"""A folder with finished results, from which the same command resumes."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import quote

import numpy as np

from DroneSwarmSearch._internal.files import try_folder, write_bytes

Result = TypeVar("Result")
Facts = Mapping[str, Any]

FINISHED = "finished"  # the folder of results
FACTS = "facts"  # the entry of a file that holds them as JSON
LONGEST_NAME = 100  # characters of a name in the name of a file


class RunFolder:
    """One file for each finished result, a dataclass of arrays and numbers.

    Each file stands for itself. It holds the facts on which its result depends, as plain data, and
    its name has their hash. So a folder may hold the results of many runs, several processes may
    write to it, and other facts never return a stored result. Without a path, nothing is kept.

    Raises:
        StorageError: the folder cannot be written.
    """

    def __init__(self, path: str | Path | None) -> None:
        self._folder = None if path is None else Path(path) / FINISHED
        if self._folder is not None:
            try_folder(self._folder)

    def load(self, name: str, facts: Facts, like: Result) -> Result | None:
        """The finished result of these facts; None if there is none.

        Args:
            name: what readers call the result.
            facts: everything that the result depends on, as plain data.
            like: a result with the shapes and types of that in the file.

        Raises:
            ValueError: the file is damaged.
        """
        if self._folder is None:
            return None
        path = self._folder / _file(name, facts)
        if not path.is_file():
            return None
        try:
            # NumPy leaves a file open that it cannot read, unless the file is given open.
            with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
                stored = dict(arrays)
            if str(stored.pop(FACTS)) != _text(facts):
                raise ValueError("it holds another result")
            return _checked(stored, like)
        except Exception as error:  # one of many types, as the file may be anything
            raise ValueError(
                f"{path} must be a finished result, but is damaged: {error or type(error)}; "
                "delete it, and the result is computed again"
            ) from None

    def save(self, name: str, facts: Facts, result: object) -> None:
        """Write a finished result, see `load`; raises StorageError if that fails."""
        if self._folder is not None:
            content = io.BytesIO()
            arrays: dict[str, Any] = {FACTS: np.array(_text(facts)), **vars(result)}
            np.savez_compressed(content, **arrays)
            write_bytes(self._folder / _file(name, facts), content.getvalue())


def file_name(text: str) -> str:
    """A text as the name of a file: other texts become other names, and none is hidden."""
    name = quote(text, safe=" ")
    if name.startswith((".", " ")):
        name = f"%{ord(name[0]):02X}{name[1:]}"
    return name


def _file(name: str, facts: Facts) -> str:
    """The name of the file of a result."""
    digest = hashlib.sha256(f"{name}\n{_text(facts)}".encode()).hexdigest()
    return f"{file_name(name)[:LONGEST_NAME]}.{digest[:16]}.npz"


def _text(facts: Facts) -> str:
    return json.dumps(facts, sort_keys=True)


def _checked(stored: dict[str, Any], like: Result) -> Result:
    """A result from its stored arrays, which must fit another result."""
    expected = vars(like)
    if stored.keys() != expected.keys():
        raise ValueError(f"it holds {', '.join(stored) or 'nothing'}")
    for name, values in stored.items():
        usual = np.asarray(expected[name])
        if values.shape != usual.shape or values.dtype.kind != usual.dtype.kind:
            raise ValueError(
                f"{name} must be {usual.dtype} of shape {usual.shape}, got {values.dtype} of "
                f"shape {values.shape}"
            )
        if not np.isfinite(values).all():
            raise ValueError(f"{name} must be finite")
    numbers = {name: values if values.ndim else values.item() for name, values in stored.items()}
    return replace(like, **numbers)  # type: ignore[type-var]
