"""Films of a search, as files. Needs the packages of the extra "video"."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from importlib import import_module
from itertools import repeat
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from PIL import Image

__all__ = ["INSTALL_HINT", "SUFFIXES", "write_film"]

INSTALL_HINT = 'pip install "DroneSwarmSearchEnvironment[video]"'

SUFFIXES = (".gif", ".mp4")

GIF_WIDTH = 600
"""Pixels across, at most, unless asked for more: a GIF is for pages, where bytes count."""

GIF_SAMPLES = 8
"""The colours of a GIF are chosen from so many of its pictures, evenly spread."""

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

    Args:
        path: the file; what it held before is lost.
        pictures: uint8, shape (height, width, 3), all alike and of even lengths; at least
            one. They are taken one by one.
        fps: pictures per second.
        hold: seconds for which the last picture stays.
        gif_width: pixels across to which wider pictures are scaled down in a GIF.

    Returns:
        The number of pictures taken.

    Raises:
        ImportError: a package of the extra "video" is missing.
        OSError: the file cannot be written.
        ValueError: the suffix is none of `SUFFIXES`.
    """
    suffix = path.suffix.lower()
    if suffix == ".gif":
        return _write_gif(path, pictures, fps, hold, gif_width)
    if suffix == ".mp4":
        return _write_mp4(path, pictures, fps, hold)
    raise ValueError(f"a film's name must end in {' or '.join(SUFFIXES)}, got {path.name!r}")


def _write_gif(path: Path, pictures: Iterable[Picture], fps: float, hold: float, width: int) -> int:
    """A GIF that repeats for ever, at most so wide; it is held in memory."""
    from PIL import Image

    images = [_shrunken(Image.fromarray(picture), width) for picture in pictures]
    # One palette for all: what stays in place stays the same in every bit, and costs none.
    palette = _palette(images)
    frames = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    duration = round(1000 / fps)
    frames[0].save(
        path,
        format="GIF",
        save_all=True,
        append_images=frames[1:],
        duration=[duration] * (len(frames) - 1) + [duration + round(1000 * hold)],
        loop=0,
    )
    return len(frames)


def _shrunken(image: Image.Image, width: int) -> Image.Image:
    """The image, no wider than that."""
    from PIL import Image

    if image.width <= width:
        return image
    # Sharper filters leave bright seams along the edges of cells.
    height = round(image.height * width / image.width)
    return image.resize((width, height), Image.Resampling.HAMMING)


def _palette(images: Sequence[Image.Image]) -> Image.Image:
    """An image with the 256 colours that serve all images alike."""
    from PIL import Image

    last, (width, height) = len(images) - 1, images[0].size
    samples = Image.new("RGB", (width, height * GIF_SAMPLES))
    for place in range(GIF_SAMPLES):
        samples.paste(images[round(place * last / (GIF_SAMPLES - 1))], (0, place * height))
    # The other methods of quantisation drop the small bright symbols.
    return samples.quantize(256, method=Image.Quantize.FASTOCTREE)


def _write_mp4(path: Path, pictures: Iterable[Picture], fps: float, hold: float) -> int:
    """An H.264 video; the last picture is repeated for as long as it stays."""
    import imageio.v2 as imageio

    import_module("imageio_ffmpeg")  # imageio would not say that this is what it lacks
    held, count = round(fps * hold), 0
    # Blocks of 2 pixels: the default of 16 would stretch the picture.
    writer: Any = imageio.get_writer(path, format="FFMPEG", fps=fps, macro_block_size=2)
    with writer:
        for count, picture in enumerate(_holding(pictures, held), 1):  # noqa: B007
            writer.append_data(picture)
    return count - held


def _holding(pictures: Iterable[Picture], times: int) -> Iterator[Picture]:
    """The pictures, and the last of them again some times."""
    picture = None
    for picture in pictures:
        yield picture
    if picture is not None:
        yield from repeat(picture, times)
