"""Pictures as a GIF or MP4 file. Needs the packages of the extra "video".

The package has its own writers, because Pillow keeps all frames of a GIF in memory, and
imageio-ffmpeg ignores ffmpeg's exit code, so a full disk would look like success.
"""

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

__all__ = ["SUFFIXES", "pictures_per_step", "write_video"]

INSTALL = 'pip install "DroneSwarmSearchEnvironment[video]"'

SUFFIXES = (".gif", ".mp4")

GIF_WIDTH = 600
"""The default width of a GIF in pixels; wider pictures are scaled down."""

SMOOTH = 25.0
"""Pictures per second of smooth motion. A GIF's delays are multiples of 1/100 s."""

GIF_SAMPLES = 8
"""The number of pictures, evenly spread over the video, from which its palette is chosen."""

UNCHANGED = 255
"""The colour index of pixels that are the same as in the previous picture."""

GIF_TICK, GIF_LONGEST = 10, 655_350
"""The unit and the longest duration of a frame of a GIF, in milliseconds."""

Picture = NDArray[np.uint8]


def pictures_per_step(steps_per_second: float) -> int:
    """The pictures of each step that make motion smooth."""
    return max(1, round(SMOOTH / steps_per_second))


def write_video(
    path: Path,
    pictures: Iterable[Picture],
    *,
    fps: float,
    hold: float,
    gif_width: int = GIF_WIDTH,
) -> int:
    """Write pictures to a file, GIF or MP4 by its suffix.

    The file appears when it is complete; after an error or an interruption, a previous file
    is still there. Memory does not grow with the number of pictures; for a GIF, they are
    stored compressed in a temporary file.

    Args:
        path: the file; its folder is created if needed.
        pictures: at least one, uint8, all of the same shape (height, width, 3). The first one
            is taken after all other checks.
        fps: pictures per second.
        hold: additional seconds for which the last picture stays.
        gif_width: the most pixels across in a GIF.

    Returns:
        The number of pictures taken.

    Raises:
        ImportError: a package of the extra "video", or its ffmpeg, is missing.
        OSError: the file cannot be written.
        TypeError: an argument is of the wrong type.
        ValueError: an argument is outside its limits, the suffix is not one of `SUFFIXES`,
            or the pictures are missing or differ in shape.
    """
    # `evaluation` has a command that makes videos.
    from DroneSwarmSearch._internal.files import replacing

    if not isinstance(path, Path):
        raise TypeError(f"path must be a pathlib.Path, got {path!r}")
    fps, hold = checks.positive("fps", fps), checks.real("hold", hold, 0)
    gif_width = checks.integer("gif_width", gif_width, 1)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise ValueError(f"path must end in {' or '.join(SUFFIXES)}, got {path.name!r}")
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
        raise ImportError(f"a video needs the package {name}: {INSTALL}", name=name) from error


def _find_ffmpeg() -> str:
    """The path of an ffmpeg that runs."""
    package = _package("imageio_ffmpeg")
    try:
        program: str = package.get_ffmpeg_exe()
        subprocess.run([program, "-version"], capture_output=True, check=True)
    except (RuntimeError, OSError, subprocess.SubprocessError) as error:
        raise ImportError(
            f"an MP4 video needs the program ffmpeg, which cannot be run ({error}): reinstall "
            "it with pip install --force-reinstall imageio-ffmpeg, or let the environment "
            "variable IMAGEIO_FFMPEG_EXE name an ffmpeg that works; GIF videos need none",
            name="imageio_ffmpeg",
        ) from error
    return program


def _checked(pictures: Iterable[Picture]) -> Iterator[Picture]:
    """The pictures, each checked for shape and type."""
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
    """Write a GIF that repeats forever."""
    from PIL import Image

    with tempfile.TemporaryFile(dir=path.parent) as spool, path.open("wb") as file:
        # The palette depends on the whole video, so the pictures go to disk first.
        ends, size = [0], (0, 0)
        for picture in pictures:
            image = _shrunken(picture, width)
            size = image.size
            spool.write(zlib.compress(image.tobytes(), 1))
            ends.append(spool.tell())
        count = len(ends) - 1

        def stored(number: int) -> Image.Image:
            start, end = ends[number : number + 2]
            spool.seek(start)
            return Image.frombytes("RGB", size, zlib.decompress(spool.read(end - start)))

        samples = (round(k * (count - 1) / (GIF_SAMPLES - 1)) for k in range(GIF_SAMPLES))
        palette = _common_palette([stored(number) for number in samples])
        images = (
            stored(number).quantize(palette=palette, dither=Image.Dither.NONE)
            for number in range(count)
        )
        _write_gif_frames(file, images, fps, hold)
    return count


def _shrunken(picture: Picture, width: int) -> Image.Image:
    """The picture as an image of at most this width."""
    from PIL import Image

    image = Image.fromarray(picture)
    if image.width <= width:
        return image
    # Sharper filters leave bright seams along the edges of cells.
    height = max(1, round(image.height * width / image.width))
    return image.resize((width, height), Image.Resampling.HAMMING)


def _common_palette(samples: list[Image.Image]) -> Image.Image:
    """An image with the palette of 255 colours that all frames use.

    With one palette, unchanged pixels keep their exact colours and need no bytes.
    """
    from PIL import Image

    width, height = samples[0].size
    joined = Image.new("RGB", (width, height * len(samples)))
    for number, sample in enumerate(samples):
        joined.paste(sample, (0, number * height))
    # The other methods of quantisation drop the small bright symbols.
    palette = joined.quantize(UNCHANGED, method=Image.Quantize.FASTOCTREE)
    colours = bytes(palette.getpalette() or ())[: 3 * UNCHANGED]
    # Unused entries repeat the first colour, so that no pixel is nearest to one of them.
    palette.putpalette((colours + 256 * colours[:3])[: 3 * 256])
    return palette


def _write_gif_frames(
    file: IO[bytes], images: Iterable[Image.Image], fps: float, hold: float
) -> None:
    """Write a GIF frame by frame.

    A frame holds only the box that differs from the previous one, with `UNCHANGED` for the
    pixels in it that do not. A picture that does not differ prolongs the previous frame.

    Args:
        file: the file to write to.
        images: at least one, with one palette that does not use `UNCHANGED`.
        fps: images per second.
        hold: additional seconds for the last one.
    """
    images = iter(images)
    first = next(images)
    width, height = first.size
    file.write(b"GIF89a" + struct.pack("<HHBBB", width, height, 0xF7, 0, 0))  # 256 colours
    file.write(bytes(first.getpalette() or ()))
    file.write(b"!\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00")  # repeat forever
    previous = changes = np.asarray(first)
    left, top, stays = 0, 0, _gif_duration(0, fps)
    for number, image in enumerate(images, 1):
        now, duration = np.asarray(image), _gif_duration(number, fps)
        changed = now != previous
        if not changed.any() and stays + duration + 1000 * hold <= GIF_LONGEST:
            stays += duration
            continue
        file.writelines(_gif_frame(changes, left, top, stays))
        rows, columns = (changed.any(axis).nonzero()[0] for axis in (1, 0))
        top, bottom = (rows[0], rows[-1]) if len(rows) else (0, 0)
        left, right = (columns[0], columns[-1]) if len(columns) else (0, 0)
        box = slice(top, bottom + 1), slice(left, right + 1)
        changes = np.where(changed[box], now[box], np.uint8(UNCHANGED))
        previous, stays = now, duration
    stays = min(stays + round(1000 * hold), GIF_LONGEST)
    file.writelines(_gif_frame(changes, left, top, stays))
    file.write(b";")


def _gif_duration(number: int, fps: float) -> int:
    """The milliseconds for which a picture stays, rounded so that the errors do not add up."""
    start, end = (round(1000 / fps * each / GIF_TICK) for each in (number, number + 1))
    return min(GIF_TICK * (end - start), GIF_LONGEST)


def _gif_frame(indices: NDArray[np.uint8], left: int, top: int, stays: int) -> list[bytes]:
    """The bytes of a frame of a GIF."""
    from PIL import Image
    from PIL.GifImagePlugin import getdata

    frame = Image.fromarray(indices)  # mode "L": the palette of the file applies
    return getdata(frame, (int(left), int(top)), duration=stays, transparency=UNCHANGED)


# MP4.


def _write_mp4(
    ffmpeg: str, path: Path, pictures: Iterator[Picture], fps: float, hold: float
) -> int:
    """Write an H.264 video that repeats the last picture for `hold` seconds."""
    first = next(pictures)
    height, width, _ = first.shape
    command = [ffmpeg, "-y", "-v", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"]
    command += ["-s", f"{width}x{height}", "-r", f"{fps!r}", "-i", "-", "-an"]
    if width % 2 or height % 2:  # the pixel format needs even lengths
        command += ["-vf", f"scale={width + width % 2}:{height + height % 2}"]
    command += ["-pix_fmt", "yuv420p", f"file:{path}"]
    held, count = round(fps * hold), 0
    with tempfile.TemporaryFile() as errors:
        process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=errors,
            start_new_session=True,  # Ctrl-C reaches this process alone, which then kills ffmpeg
        )
        assert process.stdin is not None
        try:
            for picture in _holding(chain([first], pictures), held):
                count += 1
                try:
                    process.stdin.write(picture.tobytes())
                except OSError:  # ffmpeg has exited; its exit code is checked below
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
            errors.seek(0)
            lines = errors.read().decode(errors="replace").split("\n")
            reason = next(filter(None, map(str.strip, reversed(lines))), "it gave no reason")
            raise OSError(f"ffmpeg ended with code {process.returncode}: {reason}")
    return count - held


def _holding(pictures: Iterable[Picture], times: int) -> Iterator[Picture]:
    """The pictures, with the last one repeated `times` times."""
    picture = None
    for picture in pictures:
        yield picture
    if picture is not None:
        yield from repeat(picture, times)
