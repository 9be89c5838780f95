"""Files that are written completely or not at all."""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Iterator
from pathlib import Path


class StorageError(OSError):
    """A file cannot be written. The message names it and the reason."""


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield an empty temporary file, which is moved to `path` once it has been written.

    The folder is created if necessary. If anything fails, an existing file stays unchanged; a
    StorageError says that the file cannot be written, for example because the disk is full.
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
                f"{error.strerror or error}; files written before are kept",
                str(path),
            ) from error
        raise


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file completely or not at all, as `replacing` does."""
    with replacing(path) as spare:
        spare.write_bytes(data)


def write_text(path: Path, text: str) -> None:
    """Write text as UTF-8, with its line ends unchanged, as `write_bytes` does."""
    write_bytes(path, text.encode())
