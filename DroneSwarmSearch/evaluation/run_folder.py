"""A folder with finished results, from which the same command resumes."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.files import write_bytes, write_text

__all__ = ["RunFolder", "file_name"]

MANIFEST = "manifest.json"

FINISHED = "finished"
"""The folder for finished results within the folder of a run."""


class RunFolder:
    """The manifest of a run, and one file for each finished result.

    The manifest holds everything that results depend on. A run may add policies and searches to a
    folder; it may not change what is there.

    Args:
        path: created if necessary.
        manifest: plain JSON data; entries may be nested mappings.

    Raises:
        StorageError: the folder cannot be written.
        ValueError: the folder holds results of another run; the message names what differs.
    """

    def __init__(self, path: str | Path, manifest: Mapping[str, Any]) -> None:
        if not isinstance(path, (str, Path)) or not str(path):
            raise ValueError(f"out must be a folder or None, got {path!r:.100}")
        self.path = Path(path)
        place = self.path / MANIFEST
        try:
            before = json.loads(place.read_bytes()) if place.is_file() else {}
        except ValueError as error:
            raise ValueError(f"{place} must hold the manifest of a run: {error}") from error
        now = json.loads(json.dumps(manifest))
        write_text(place, json.dumps(self._merged(before, now), indent=1) + "\n")

    def _merged(
        self, before: dict[str, Any], now: dict[str, Any], where: str = ""
    ) -> dict[str, Any]:
        """The entries of both manifests; raises a ValueError if one differs."""
        merged = {**before, **now}
        for key in before.keys() & now.keys():
            old, new = before[key], now[key]
            if isinstance(old, dict) and isinstance(new, dict):
                merged[key] = self._merged(old, new, f"{where}{key}: ")
            elif old != new:
                raise ValueError(
                    f"out must be a new folder, or the run in {self.path} the same: its {where}"
                    f"{key} is {old!r:.100}, got {new!r:.100}"
                )
        return merged

    def load(self, name: str) -> dict[str, NDArray[Any]] | None:
        """The arrays of a finished result; None if there are none, or the file is damaged."""
        try:
            with np.load(self._place(name)) as file:
                return {key: file[key] for key in file.files}
        except (OSError, ValueError, BadZipFile):
            return None

    def save(self, name: str, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Write a finished result.

        Raises:
            StorageError: it cannot be written. Earlier results are kept.
        """
        content = io.BytesIO()
        np.savez_compressed(content, allow_pickle=False, **arrays)
        write_bytes(self._place(name), content.getvalue())

    def _place(self, name: str) -> Path:
        return self.path / FINISHED / f"{file_name(name)}.npz"


def file_name(text: str) -> str:
    """A text as the name of a file."""
    return "".join(sign if sign.isalnum() or sign in "-_." else "-" for sign in text).strip(".-")
