"""A folder that holds one plan: an earlier plan's files go when the new ones are complete."""

from __future__ import annotations

import hashlib
import json
import os
import re
import secrets
import shutil
from collections.abc import Callable
from pathlib import Path

from DroneSwarmSearch._internal.files import StorageError, parsed_json, try_folder, write_text

CONTENTS = "contents.json"
"""It holds the names of a plan's files and their SHA-256, by which the next plan knows them."""

INCIDENT = "incident.json"
"""The last file that is moved in: without it, a folder holds no plan."""

NAMES = re.compile(
    r"plan\.(csv|geojson|gpx|html|kml)|overlay(_west|_east)?\.png|map\d*\.(png|svg)"
    rf"|drone\d+\.(plan|waypoints|kmz)|{re.escape(INCIDENT)}|{re.escape(CONTENTS)}"
)
"""The names of files that a plan may write."""

ENOUGH = 2**21  # bytes that are tried; the files of a plan take about half of it


def try_plan_folder(folder: Path) -> None:
    """Create a folder if necessary, and raise an error if a plan cannot be written there.

    Raises:
        StorageError: the disk is full, or the folder cannot be written.
        ValueError: it holds a file that no plan has written, with a name that a plan may need.
    """
    try_folder(folder, ENOUGH)
    earlier = _contents(folder)
    foreign = [name for name in _names(folder) if NAMES.fullmatch(name) and name not in earlier]
    if foreign:
        raise ValueError(
            f"out must be a folder without files of other origin under the names of a plan's, got "
            f"{folder} with {listed(foreign)}"
        )


def replace_plan(folder: Path, write: Callable[[Path], None]) -> list[str]:
    """Replace a folder's plan by what `write` writes to another folder.

    That is a temporary one, inside of `folder`, whose files are moved when all are complete. If
    anything fails before, the folder stays as it was. Files of an earlier plan that the new one
    lacks are removed, unless they have been changed since.

    Returns:
        The names of all other files, which are left.
    """
    try_plan_folder(folder)
    spare = folder / f".{secrets.token_hex(8)}"
    try:
        spare.mkdir()
        write(spare)
        new = {name: _digest(spare / name) for name in _names(spare)}
        write_text(spare / CONTENTS, json.dumps(new, indent=1) + "\n")
        _move(spare, folder, new)
    except OSError as error:
        raise StorageError(error.errno, error.strerror or str(error), str(folder)) from error
    finally:
        shutil.rmtree(spare, ignore_errors=True)
    return [name for name in _names(folder) if name not in (*new, CONTENTS)]


def listed(names: list[str]) -> str:
    """The first few of some names, and how many more there are."""
    few = ", ".join(names[:5])
    return few if len(names) <= 5 else f"{few} and {len(names) - 5} more"


def _move(spare: Path, folder: Path, new: dict[str, str]) -> None:
    """Move new files in, and remove those of the earlier plan."""
    earlier = _contents(folder)
    (folder / INCIDENT).unlink(missing_ok=True)
    for name, digest in earlier.items():
        path = folder / name
        if name not in new and path.is_file() and _digest(path) == digest:
            path.unlink()
    for name in (CONTENTS, *sorted(new.keys() - {INCIDENT}), INCIDENT):
        os.replace(spare / name, folder / name)


def _names(folder: Path) -> list[str]:
    """What is in a folder, but for hidden files."""
    return sorted(path.name for path in folder.iterdir() if not path.name.startswith("."))


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _contents(folder: Path) -> dict[str, str]:
    """The files of the plan that is in a folder, with their SHA-256; none if there is no plan."""
    path = folder / CONTENTS
    if not path.is_file():
        return {}
    try:
        data = parsed_json(path.read_bytes())
        names = {str(name): str(digest) for name, digest in data.items() if NAMES.fullmatch(name)}
    except (AttributeError, TypeError, ValueError) as error:
        raise ValueError(f"{path} must hold the names of a plan's files, but: {error}") from None
    return {CONTENTS: "", **names}
