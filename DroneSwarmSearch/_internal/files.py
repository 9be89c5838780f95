"""Files that are written completely or not at all."""

from __future__ import annotations

import contextlib
import csv
import json
import os
import secrets
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

FORMULAS = ("=", "+", "-", "@", "\t", "\r")  # what formulas of spreadsheets begin with


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


def parsed_json(content: bytes, object_hook: Callable[[dict[str, Any]], Any] | None = None) -> Any:
    """What a JSON file holds; it may begin with a byte order mark.

    Raises:
        ValueError: it is not JSON in UTF-8, or its brackets are nested too deeply.
    """
    try:
        return json.loads(content.decode("utf-8-sig"), object_hook=object_hook)
    except UnicodeDecodeError as error:
        raise ValueError(f"JSON must be in UTF-8, but byte {error.start} is not") from None
    except RecursionError:
        raise ValueError("JSON must not be nested so deeply") from None


def csv_rows(path: Path, lacking: str | None = "") -> Iterator[tuple[int, dict[str, Any]]]:
    """The rows of a CSV file by the names of its columns, with the numbers of their lines.

    Cells that a row lacks are `lacking`.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is no CSV file in UTF-8.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = csv.DictReader(file, restval=lacking, skipinitialspace=True)
            for row in rows:
                yield rows.line_num, row
    except (UnicodeError, csv.Error) as error:
        raise ValueError(f"{path} must be a CSV file in UTF-8: {error}") from None


def csv_cell(value: object) -> object:
    """A cell of a CSV file; text that a spreadsheet would execute begins with an apostrophe."""
    if isinstance(value, str) and value.startswith(FORMULAS):
        return f"'{value}"
    return value


def try_folder(folder: Path, size: int = 1) -> None:
    """Create a folder if necessary, and try whether `size` bytes can be written there.

    Call it before long work whose results go there.

    Raises:
        StorageError: they cannot be written.
    """
    spare = folder / f".{secrets.token_hex(8)}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        try:
            with spare.open("wb") as file:
                file.write(bytes(size))
                os.fsync(file.fileno())
        finally:
            spare.unlink(missing_ok=True)
    except OSError as error:
        raise StorageError(error.errno, error.strerror or str(error), str(folder)) from error


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file completely or not at all, as `replacing` does."""
    with replacing(path) as spare:
        spare.write_bytes(data)


def write_text(path: Path, text: str) -> None:
    """Write text as UTF-8, with its line ends unchanged, as `write_bytes` does."""
    write_bytes(path, text.encode())
