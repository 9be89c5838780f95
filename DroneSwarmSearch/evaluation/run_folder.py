"""A folder with finished results, from which the same command resumes."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from DroneSwarmSearch._internal.files import write_bytes, write_text

Result = TypeVar("Result")

MANIFEST, FINISHED = "manifest.json", "finished"  # a file, and the folder of results


class RunFolder:
    """The manifest of a run, and one file for each finished result, a dataclass of arrays.

    The manifest holds everything that results depend on. A run may add policies and searches, but
    not change what is there. Without a path, nothing is kept.

    Raises StorageError if the folder cannot be written, and ValueError if it holds another run.
    """

    def __init__(self, path: str | Path | None, manifest: Mapping[str, Any]) -> None:
        self.path = None if path is None else Path(path)
        if self.path is None:
            return
        place, before = self.path / MANIFEST, {}
        if place.is_file():
            before = json.loads(place.read_bytes())
        for key in before.keys() & manifest.keys():
            if before[key] != manifest[key]:
                raise ValueError(
                    f"out must be a new folder, or the run in {path} the same: its {key} is "
                    f"{before[key]!r:.100}, got {manifest[key]!r:.100}"
                )
        write_text(place, json.dumps({**before, **manifest}, indent=1) + "\n")

    def load(self, name: str, kind: Callable[..., Result]) -> Result | None:
        """A finished result; None if there is none."""
        if self.path is None or not self._place(self.path, name).is_file():
            return None
        with np.load(self._place(self.path, name)) as file:
            return kind(**{name: v if v.ndim else v.item() for name, v in file.items()})

    def save(self, name: str, result: object) -> None:
        """Write a finished result; raises StorageError if that fails. Earlier results are kept."""
        if self.path is not None:
            content = io.BytesIO()
            np.savez_compressed(content, **vars(result))
            write_bytes(self._place(self.path, name), content.getvalue())

    @staticmethod
    def _place(folder: Path, name: str) -> Path:
        return folder / FINISHED / f"{file_name(name)}.npz"


def file_name(text: str) -> str:
    """A text as the name of a file."""
    return "".join(sign if sign.isalnum() or sign in "-_." else "-" for sign in text).strip(".-")
