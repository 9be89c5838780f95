"""Files that are there as a whole or not at all, and a store of finished work."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import secrets
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

import DroneSwarmSearch
from DroneSwarmSearch.evaluation.suite import SUITE_VERSION

__all__ = ["StorageError", "Store", "replacing", "write_bytes", "write_text"]

_APART = ("rendering", "bench", "demo.py", "evaluation", "training", "wrappers", "__main__.py")
"""Parts of the package that no figure depends on, but for `_NOT_APART`."""

_HASHED = (".py", ".npz")
"""Code, and weights."""

_NOT_APART = ("evaluation/episodes.py", "evaluation/statistics.py")


_HASH = "sha256"
"""The name under which an entry holds the hash of its content."""


class StorageError(OSError):
    """A file could not be written; the message says which, why, and what is left."""


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A file to be written that takes a place once it is complete.

    Until all of it is on the disk, what was there before stays; if anything fails, for good.

    Args:
        path: the place; its folder is made if need be.

    Yields:
        The file to write, empty, in the same folder and with the same suffix.

    Raises:
        StorageError: the file cannot be written, because the disk is full for example.
    """
    spare = path.with_name(f".{path.stem}.{secrets.token_hex(4)}{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        spare.touch(exist_ok=False)
        yield spare
        with spare.open("rb+") as file:
            os.fsync(file.fileno())
        os.replace(spare, path)
    except BaseException as error:
        with contextlib.suppress(OSError):
            spare.unlink()
        if isinstance(error, OSError):
            raise StorageError(
                error.errno,
                f"{error.strerror or error}; what was written before is kept",
                str(path),
            ) from error
        raise


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file; until all of it is on the disk, what was there before stays.

    Args:
        path: its folder is made if need be.
        data: all that the file is to hold.

    Raises:
        StorageError: the file cannot be written, because the disk is full for example.
    """
    with replacing(path) as spare:
        spare.write_bytes(data)


def write_text(path: Path, text: str) -> None:
    """Write a file as `write_bytes` does; the text as UTF-8, its line ends as they are."""
    write_bytes(path, text.encode(errors="backslashreplace"))  # of a path that is no text, too


class Store:
    """Finished work in a folder, found again by what it follows from.

    An entry is a JSON file whose name is a hash of its key, and which holds a hash of its
    content. To every key are added the versions of package, suite and NumPy and a hash of the
    code that figures depend on: what other code has worked out is not found.

    Args:
        directory: made with the first entry.
    """

    def __init__(self, directory: str | Path) -> None:
        self.directory = Path(directory)

    def load(self, key: Mapping[str, Any]) -> Any:
        """The entry of a key, or None if there is none; a damaged file counts as none.

        Args:
            key: plain data, as JSON has it.

        Raises:
            StorageError: there is a file in the place of the store's folder.
        """
        full = self._full(key)
        path = self._path(full)
        with contextlib.suppress(KeyError, OSError, RecursionError, TypeError, ValueError):
            told = json.loads(path.read_bytes()) if path.is_file() else {}
            content = {"key": full, "entry": told["entry"]}
            if told == {**content, _HASH: _hash(content)}:
                return told["entry"]
        self._check_place()
        return None

    def save(self, key: Mapping[str, Any], entry: Any) -> None:
        """Keep an entry; what is in its place is replaced, a folder renamed.

        Args:
            key: plain data, as JSON has it.
            entry: the same.

        Raises:
            StorageError: it cannot be written; earlier entries stay.
        """
        full = self._full(key)
        path = self._path(full)
        content = {"key": full, "entry": json.loads(json.dumps(entry))}
        if path.is_dir():
            with contextlib.suppress(OSError):  # if it stays, writing says why
                path.rename(path.with_name(f"{path.stem}.{secrets.token_hex(4)}.folder"))
        write_text(path, json.dumps({**content, _HASH: _hash(content)}) + "\n")

    def __len__(self) -> int:
        """The number of entries, of whatever version."""
        return sum(1 for _ in self.directory.glob("*.json"))

    def _check_place(self) -> None:
        """Refuse a folder that can never be made, before any work is done for it."""
        lineage = (self.directory, *self.directory.parents)
        nearest = next(filter(os.path.exists, lineage), None)
        if nearest is not None and not nearest.is_dir():
            raise StorageError(
                errno.ENOTDIR,
                "finished work needs a folder, and this is a file; move it",
                str(nearest),
            )

    def _path(self, full: dict[str, Any]) -> Path:
        return self.directory / f"{_hash(full)[:40]}.json"

    @staticmethod
    def _full(key: Mapping[str, Any]) -> dict[str, Any]:
        """The key with the versions, as it comes back from JSON."""
        versions = {
            "package": DroneSwarmSearch.__version__,
            "suite": SUITE_VERSION,
            "numpy": np.__version__,
            "code": code_fingerprint(),
        }
        full: dict[str, Any] = json.loads(json.dumps({**versions, **key}))
        return full


def _hash(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


@lru_cache(maxsize=1)
def code_fingerprint() -> str:
    """A hash of the sources and weights that figures depend on."""
    home = Path(DroneSwarmSearch.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(path for path in home.rglob("*") if path.suffix in _HASHED):
        name = path.relative_to(home).as_posix()
        if name in _NOT_APART or name.split("/")[0] not in _APART:
            digest.update(f"{name}\0".encode() + path.read_bytes() + b"\0")
    return digest.hexdigest()
