"""Films of a search, as files. Needs the packages of the extra "video"."""

from __future__ import annotations

import errno
import os
import struct
import subprocess
import tempfile
import zlib
from collections.abc import Iterable, Iterator
from contextlib import suppress
from importlib import import_module
from itertools import chain, repeat
from pathlib import Path
from types import ModuleType
from typing import IO, TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks

if TYPE_CHECKING:
    from PIL import Image

__all__ = ["SUFFIXES", "write_film"]

INSTALL = 'pip install "DroneSwarmSearchEnvironment[video]"'

SUFFIXES = (".gif", ".mp4")

GIF_WIDTH = 600
"""Pixels across, at most, unless asked for more: a GIF is for pages, where bytes count."""

GIF_SAMPLES = 8
"""The colours of a GIF are chosen from so many of its pictures, evenly spread."""

UNCHANGED = 255
"""The colour of a GIF that stands for the pixel of the picture before."""

GIF_LONGEST = 655_350
"""Milliseconds for which one picture of a GIF can stay."""

Picture = NDArray[np.uint8]


def write_film(
    path: Path,
    pictures: Iterable[Picture],
    *,
    fps: float,
    hold: float,
    gif_width: int = GIF_WIDTH,
) -> int:
    """Write pictures to a file, GIF or MP4 by its suffix.

    The file appears when it is complete. If anything fails, what it held before stays. The
    memory needed does not grow with the number of pictures; a GIF needs space for them on
    the disk while it is made.

    Args:
        path: the file; its folder is made if need be.
        pictures: uint8, shape (height, width, 3), all alike; at least one. They are taken
            one by one, the first after everything that a film needs has been found.
        fps: pictures per second.
        hold: seconds for which the last picture stays.
        gif_width: pixels across to which wider pictures are scaled down in a GIF.

    Returns:
        The number of pictures taken.

    Raises:
        ImportError: a package of the extra "video" is missing, or its ffmpeg.
        OSError: the file cannot be written.
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of its limits, the suffix is none of `SUFFIXES`, or the
            pictures are none or differ in shape.
    """
    # `evaluation` has a command that makes films.
    from DroneSwarmSearch._internal.files import replacing

    if not isinstance(path, Path):
        raise TypeError(f"path must be a pathlib.Path, got {path!r}")
    fps, hold = checks.positive("fps", fps), checks.real("hold", hold, 0)
    gif_width = checks.integer("gif_width", gif_width, 1)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise ValueError(f"a film's name must end in {' or '.join(SUFFIXES)}, got {path.name!r}")
    ffmpeg = None
    if suffix == ".gif":
        _package("PIL")
    else:
        ffmpeg = _find_ffmpeg()
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    with replacing(path) as spare:
        if ffmpeg is None:
            return _write_gif(spare, _checked(pictures), fps, hold, gif_width)
        return _write_mp4(ffmpeg, spare, _checked(pictures), fps, hold)


def _package(name: str) -> ModuleType:
    try:
        return import_module(name)
    except ImportError as error:
        raise ImportError(f"a film needs the package {name}: {INSTALL}", name=name) from error


def _find_ffmpeg() -> str:
    """The program that makes MP4 files, tried out."""
    package = _package("imageio_ffmpeg")
    try:
        program: str = package.get_ffmpeg_exe()
        subprocess.run([program, "-version"], capture_output=True, check=True)
    except (RuntimeError, OSError, subprocess.SubprocessError) as error:
        raise ImportError(
            f"an MP4 film needs the program ffmpeg, which cannot be run ({error}): reinstall "
            "it with pip install --force-reinstall imageio-ffmpeg, or let the environment "
            "variable IMAGEIO_FFMPEG_EXE name an ffmpeg that works; GIF films need none",
            name="imageio_ffmpeg",
        ) from error
    return program


def _checked(pictures: Iterable[Picture]) -> Iterator[Picture]:
    """The pictures; an error if there is none, or one of another shape or type."""
    shape = None
    for picture in pictures:
        if shape is None and picture.ndim == 3 and picture.shape[2] == 3:
            shape = picture.shape
        if picture.dtype != np.uint8 or picture.shape != shape:
            raise ValueError(
                "pictures must be uint8 arrays of one shape (height, width, 3), got "
                f"{picture.dtype} of shape {picture.shape}"
                + (f" after {shape}" if shape is not None else "")
            )
        yield picture
    if shape is None:
        raise ValueError("pictures must be at least one, got none")


# GIF.


def _write_gif(path: Path, pictures: Iterable[Picture], fps: float, hold: float, width: int) -> int:
    """A GIF that repeats for ever, at most so wide."""
    with tempfile.TemporaryFile(dir=path.parent) as spool, path.open("wb") as file:
        # The palette depends on pictures from the whole film: they go to the disk first.
        places, size = [], (0, 0)
        for picture in pictures:
            image = _shrunken(picture, width)
            places.append(spool.tell())
            size = image.size
            spool.write(zlib.compress(image.tobytes(), 1))
        images = _Images(spool, [*places, spool.tell()], size)
        palette = _palette(images)
        _write_gif_frames(file, (_quantised(image, palette) for image in images), fps, hold)
    return len(places)


class _Images:
    """Images in a file, read one at a time."""

    def __init__(self, file: IO[bytes], places: list[int], size: tuple[int, int]) -> None:
        self._file, self._places, self.size = file, places, size

    def __len__(self) -> int:
        return len(self._places) - 1

    def __getitem__(self, number: int) -> Image.Image:
        from PIL import Image

        begin, end = self._places[number : number + 2]
        self._file.seek(begin)
        return Image.frombytes("RGB", self.size, zlib.decompress(self._file.read(end - begin)))

    def __iter__(self) -> Iterator[Image.Image]:
        return map(self.__getitem__, range(len(self)))


def _shrunken(picture: Picture, width: int) -> Image.Image:
    """The picture as an image, no wider than that."""
    from PIL import Image

    image = Image.fromarray(picture)
    if image.width <= width:
        return image
    # Sharper filters leave bright seams along the edges of cells.
    height = max(1, round(image.height * width / image.width))
    return image.resize((width, height), Image.Resampling.HAMMING)


def _palette(images: _Images) -> Image.Image:
    """An image with the 255 colours that serve all images alike.

    One palette for all: what stays in place stays the same in every bit, and costs none.
    """
    from PIL import Image

    last, (width, height) = len(images) - 1, images.size
    samples = Image.new("RGB", (width, height * GIF_SAMPLES))
    for place in range(GIF_SAMPLES):
        samples.paste(images[round(place * last / (GIF_SAMPLES - 1))], (0, place * height))
    # The other methods of quantisation drop the small bright symbols.
    palette = samples.quantize(UNCHANGED, method=Image.Quantize.FASTOCTREE)
    colours = bytes(palette.getpalette() or ())[: 3 * UNCHANGED]
    # The colours left over repeat the first, lest any pixel is nearest to one of them.
    palette.putpalette((colours + 256 * colours[:3])[: 3 * 256])
    return palette


def _quantised(image: Image.Image, palette: Image.Image) -> Image.Image:
    from PIL import Image

    return image.quantize(palette=palette, dither=Image.Dither.NONE)


def _write_gif_frames(
    file: IO[bytes], images: Iterable[Image.Image], fps: float, hold: float
) -> None:
    """Write a GIF frame by frame; Pillow would keep all frames in memory.

    The images, at least one, have a palette in common, which leaves out `UNCHANGED`. Of each
    only the box that differs from the image before is written, with `UNCHANGED` for the
    pixels in it that do not. An image that does not differ at all prolongs the one before.
    """
    duration, images = min(round(1000 / fps), GIF_LONGEST), iter(images)
    first = next(images)
    width, height = first.size
    file.write(b"GIF89a" + struct.pack("<HHBBB", width, height, 0xF7, 0, 0))  # 256 colours
    file.write(bytes(first.getpalette() or ()))
    file.write(b"!\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00")  # repeat for ever
    before = changes = np.asarray(first)
    left, top, stays = 0, 0, duration
    for image in images:
        now = np.asarray(image)
        changed = now != before
        if not changed.any() and stays + duration + 1000 * hold <= GIF_LONGEST:
            stays += duration
            continue
        file.writelines(_gif_frame(changes, left, top, stays))
        rows, columns = (changed.any(axis).nonzero()[0] for axis in (1, 0))
        top, bottom = (rows[0], rows[-1]) if len(rows) else (0, 0)
        left, right = (columns[0], columns[-1]) if len(columns) else (0, 0)
        box = slice(top, bottom + 1), slice(left, right + 1)
        changes = np.where(changed[box], now[box], np.uint8(UNCHANGED))
        before, stays = now, duration
    stays = min(stays + round(1000 * hold), GIF_LONGEST)
    file.writelines(_gif_frame(changes, left, top, stays))
    file.write(b";")


def _gif_frame(indices: NDArray[np.uint8], left: int, top: int, stays: int) -> list[bytes]:
    """A frame of a GIF, as the file has it."""
    from PIL import Image
    from PIL.GifImagePlugin import getdata

    frame = Image.fromarray(indices)  # "L": the colours of the whole film hold
    return getdata(frame, (int(left), int(top)), duration=stays, transparency=UNCHANGED)


# MP4.


def _write_mp4(
    ffmpeg: str, path: Path, pictures: Iterator[Picture], fps: float, hold: float
) -> int:
    """An H.264 video; the last picture is repeated for as long as it stays."""
    first = next(pictures)
    height, width, _ = first.shape
    command = [ffmpeg, "-y", "-v", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"]
    command += ["-s", f"{width}x{height}", "-r", f"{fps!r}", "-i", "-", "-an"]
    if width % 2 or height % 2:  # which this pixel format cannot have
        command += ["-vf", f"scale={width + width % 2}:{height + height % 2}"]
    command += ["-pix_fmt", "yuv420p", f"file:{path}"]
    held, count = round(fps * hold), 0
    with tempfile.TemporaryFile() as complaints:
        process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=complaints,
            start_new_session=True,  # Ctrl-C is for this process, which then ends the other
        )
        assert process.stdin is not None
        try:
            for picture in _holding(chain([first], pictures), held):
                count += 1
                try:
                    process.stdin.write(picture.tobytes())
                except OSError:  # ffmpeg has ended; its exit code is looked at below
                    break
            with suppress(OSError):
                process.stdin.close()
            failed = process.wait() != 0
        except BaseException:
            process.kill()
            with suppress(OSError):
                process.stdin.close()
            process.wait()
            raise
        if failed:
            complaints.seek(0)
            lines = complaints.read().decode(errors="replace").split("\n")
            reason = next(filter(None, map(str.strip, reversed(lines))), "it gave no reason")
            raise OSError(f"ffmpeg ended with code {process.returncode}: {reason}")
    return count - held


def _holding(pictures: Iterable[Picture], times: int) -> Iterator[Picture]:
    """The pictures, and the last of them again some times."""
    picture = None
    for picture in pictures:
        yield picture
    if picture is not None:
        yield from repeat(picture, times)
