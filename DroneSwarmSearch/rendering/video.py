"""Frames as a GIF or MP4 file, by the ffmpeg of imageio-ffmpeg (the extra "video")."""

from __future__ import annotations

import contextlib
import itertools
import subprocess
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.extras import needed
from DroneSwarmSearch._internal.files import replacing
from DroneSwarmSearch.core.frame import Frame
from DroneSwarmSearch.core.grid import Cell
from DroneSwarmSearch.rendering.palette import Look, shares_of_maximum

SUFFIXES = (".gif", ".mp4")
# the range of steps per second; a GIF cannot show more
FPS_LEAST = 0.1
FPS_MOST = 50.0
LONGEST_REASON = 100  # characters
SHOWN_FROM = 0.05  # the share of a map's maximum from which a cell is never cropped away
SMOOTH = 25.0  # pictures per second of smooth motion
LOSSLESS = ["-c:v", "libx264rgb", "-qp", "0", "-preset", "ultrafast"]
EVEN = "scale=ceil(iw/2)*2:ceil(ih/2)*2,format=yuv420p"  # as MP4 requires

# Without dithering, what does not move keeps its colours and needs no bytes.
PALETTE = "[0]palettegen[palette];[1][palette]paletteuse=dither=none:diff_mode=rectangle"


def write_video(
    path: Path, frames: Iterable[Frame], look: Look, *, title: str, fps: float, hold: float
) -> None:
    """Write the frames of consecutive steps as a smooth film; `fps` is in steps per second.

    The map is cropped to where something happens. A long title is cut to its first sentence.

    The frames are taken after all checks; see `write_pictures`.
    """
    from DroneSwarmSearch.rendering.painter import Painter

    per_step = max(1, round(SMOOTH / fps))

    def pictures() -> Iterator[NDArray[np.uint8]]:
        played = cropped(list(frames))
        reason = title
        if len(title) > LONGEST_REASON:
            reason = title.removesuffix(".").partition(". ")[0] + "."
        painter = Painter(played[0].grid_size, look, view="film", reason=reason)
        yield painter.pixels(played[0])
        for frame, following in itertools.pairwise(played):
            for part in range(1, per_step):
                yield painter.pixels(frame, towards=following, progress=part / per_step)
            yield painter.pixels(following)

    write_pictures(path, pictures(), fps=fps * per_step, hold=hold)


def cropped(frames: Sequence[Frame]) -> list[Frame]:
    """The frames of an episode on the smallest square grid that holds all that is seen in them."""
    likely = [shares_of_maximum(frame.matrix) > SHOWN_FROM for frame in frames]
    cells = [np.argwhere(np.any(likely, axis=0))[:, ::-1]]
    for frame in frames:
        cells += [np.array(seen, np.int64).reshape(-1, 2) for seen in (frame.drones, frame.persons)]
    low = np.vstack(cells).min(axis=0)
    high = np.vstack(cells).max(axis=0)
    most = frames[0].grid_size
    size = min(int((high - low).max()) + 3, most)
    left, top = np.clip((low + high - size + 1) // 2, 0, most - size).tolist()
    return [_part(frame, left, top, size) for frame in frames]


def _part(frame: Frame, left: int, top: int, size: int) -> Frame:
    """A frame on the square part of its grid that begins in the column `left` and the row `top`."""
    rows = slice(top, top + size)
    columns = slice(left, left + size)
    prior = frame.prior
    if prior is not None:
        prior = prior[rows, columns]

    def moved(cells: Iterable[Cell]) -> tuple[Cell, ...]:
        return tuple((x - left, y - top) for x, y in cells)

    return replace(
        frame,
        matrix=frame.matrix[rows, columns],
        prior=prior,
        drones=moved(frame.drones),
        persons=moved(frame.persons),
        trails=tuple(moved(trail) for trail in frame.trails),
        searched=tuple((x - left, y - top, age) for x, y, age in frame.searched),
        land=moved(frame.land),
    )


def write_pictures(
    path: Path, pictures: Iterable[NDArray[np.uint8]], *, fps: float, hold: float
) -> None:
    """Write one or more pictures of shape (height, width, 3) to a file, GIF or MP4 by its suffix.

    The last one stays for `hold` additional seconds. The file appears when it is complete; after an
    error, a previous file is still there. Memory does not grow with the number of pictures.

    Raises ImportError without imageio-ffmpeg (the extra "video"), OSError if the file cannot be
    written, and ValueError if the suffix is not one of `SUFFIXES`.
    """
    checks.suffix("path", path, SUFFIXES)
    imageio = needed("imageio_ffmpeg", "a video needs the package imageio_ffmpeg", "video")
    ffmpeg = [imageio.get_ffmpeg_exe(), "-y", "-v", "error"]
    left = iter(pictures)
    first = next(left)
    height, width, _ = first.shape
    shape = ["-s", f"{width}x{height}", "-r", f"{fps}"]
    read = [*ffmpeg, "-f", "rawvideo", "-pix_fmt", "rgb24", *shape, "-i", "-"]
    stay = f"tpad=stop_mode=clone:stop_duration={hold}"
    with replacing(path) as spare, tempfile.TemporaryDirectory(dir=path.parent) as folder:
        every = itertools.chain([first], left)
        if path.suffix.lower() == ".mp4":
            _run([*read, "-vf", f"{EVEN},{stay}", "-preset", "veryfast", str(spare)], every)
        else:  # the palette depends on all pictures, so they go to disk first
            video = str(Path(folder, "pictures.mkv"))
            _run([*read, *LOSSLESS, video], every)
            twice = [*ffmpeg, "-i", video, "-i", video, "-filter_complex"]
            _run([*twice, f"{PALETTE},{stay}", str(spare)])


def _run(command: list[str], pictures: Iterable[NDArray[np.uint8]] = ()) -> None:
    """Run ffmpeg, which reads pictures; raises OSError if it fails."""
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # its message says why it ended
            for picture in pictures:
                process.stdin.write(picture.data)
        _, problem = process.communicate()
    if process.returncode:
        reason = problem.decode(errors="replace").strip().rpartition("\n")[2]
        raise OSError(f"ffmpeg ended with code {process.returncode}: {reason}")
