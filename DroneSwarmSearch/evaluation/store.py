"""A folder of finished work, from which an interrupted evaluation resumes."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import secrets
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import DroneSwarmSearch
from DroneSwarmSearch._internal.files import StorageError, write_text
from DroneSwarmSearch.evaluation.suite import versions

__all__ = ["Store", "as_store"]

_WITHOUT_EFFECT = ("rendering", "training", "evaluation", "demo.py", "cli.py", "__main__.py")
"""Parts of the package on which no stored result depends, except `_WITH_EFFECT`."""

_WITH_EFFECT = tuple(
    f"evaluation/{name}.py" for name in ("conditional", "episodes", "exact", "rollout")
)

_CODE_AND_WEIGHTS = (".py", ".npz")

_HASH = "sha256"
"""The key under which an entry holds the hash of its content."""


class Store:
    """Finished work in a folder: one JSON file for each entry.

    The file name is a hash of the entry's key, and the file holds a hash of its content. The
    versions of the package, the suite and NumPy and a hash of the package's code are part of
    every key, so entries written by other code are not found.

    Args:
        directory: created with the first entry.
    """

    def __init__(self, directory: str | Path) -> None:
        self.directory = Path(directory)

    def load(self, key: Mapping[str, Any]) -> Any:
        """Return the entry of a key, or None if it is missing or damaged.

        Args:
            key: plain JSON data.

        Raises:
            StorageError: the entry is missing, and the store's folder cannot be written, or a
                file is in its place.
        """
        path, full = self._place(key)
        with contextlib.suppress(KeyError, OSError, RecursionError, TypeError, ValueError):
            found = json.loads(path.read_bytes()) if path.is_file() else {}
            content = {"key": full, "entry": found["entry"]}
            if found == {**content, _HASH: _hash(content)}:
                return found["entry"]
        self._check_directory()
        return None

    def save(self, key: Mapping[str, Any], entry: Any) -> None:
        """Save an entry. It replaces a file of the same name; a folder is renamed.

        Args:
            key: plain JSON data.
            entry: plain JSON data.

        Raises:
            StorageError: the entry cannot be written. Earlier entries are kept.
        """
        path, full = self._place(key)
        content = {"key": full, "entry": json.loads(json.dumps(entry))}
        if path.is_dir():
            with contextlib.suppress(OSError):  # writing then reports the reason
                path.rename(path.with_name(f"{path.stem}.{secrets.token_hex(4)}.folder"))
        write_text(path, json.dumps({**content, _HASH: _hash(content)}) + "\n")

    def __len__(self) -> int:
        """The number of entries, those of other versions included."""
        return sum(1 for _ in self.directory.glob("*.json"))

    def _check_directory(self) -> None:
        """Raise if the folder cannot be created, before any work is done for it."""
        folders = (self.directory, *self.directory.parents)
        nearest = next(filter(os.path.exists, folders), None)
        if nearest is not None and not nearest.is_dir():
            raise StorageError(
                errno.ENOTDIR, "results need a folder, but this is a file; move it", str(nearest)
            )
        if nearest is not None and not os.access(nearest, os.W_OK):
            raise StorageError(
                errno.EACCES,
                f"results cannot be written: {os.strerror(errno.EACCES)}",
                str(nearest),
            )

    def _place(self, key: Mapping[str, Any]) -> tuple[Path, dict[str, Any]]:
        """The file of a key, and the key with all versions, as JSON returns it."""
        found = {**versions(), "code": code_fingerprint(), **key}
        full: dict[str, Any] = json.loads(json.dumps(found))
        return self.directory / f"{_hash(full)[:40]}.json", full


def as_store(value: object) -> Store | None:
    """Return a `Store` from a `Store`, a folder or None.

    Raises:
        TypeError: `value` is something else.
    """
    if value is None or isinstance(value, Store):
        return value
    if isinstance(value, (str, Path)):
        return Store(value)
    raise TypeError(f"store must be a Store, a folder or None, got {value!r}")


def _hash(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


@lru_cache(maxsize=1)
def code_fingerprint() -> str:
    """Hash the code and the network weights on which stored results depend."""
    home = Path(DroneSwarmSearch.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(path for path in home.rglob("*") if path.suffix in _CODE_AND_WEIGHTS):
        name = path.relative_to(home).as_posix()
        if name in _WITH_EFFECT or name.split("/")[0] not in _WITHOUT_EFFECT:
            digest.update(f"{name}\0".encode() + path.read_bytes() + b"\0")
    return digest.hexdigest()
