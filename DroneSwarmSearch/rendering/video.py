"""Frames as a GIF or MP4 file, by the ffmpeg of imageio-ffmpeg (the extra "video")."""

from __future__ import annotations

import contextlib
import itertools
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.extras import needed
from DroneSwarmSearch._internal.files import replacing
from DroneSwarmSearch.core.frame import Frame
from DroneSwarmSearch.rendering.palette import Look

SUFFIXES = (".gif", ".mp4")
FPS_LEAST, FPS_MOST = 0.1, 50.0  # the range of steps per second; a GIF cannot show more
SMOOTH = 25.0  # pictures per second of smooth motion
LOSSLESS = ["-c:v", "libx264rgb", "-qp", "0", "-preset", "ultrafast"]
EVEN = "scale=ceil(iw/2)*2:ceil(ih/2)*2,format=yuv420p"  # as MP4 requires

# Without dithering, what does not move keeps its colours and needs no bytes.
PALETTE = "[0]palettegen[palette];[1][palette]paletteuse=dither=none:diff_mode=rectangle"


def write_video(
    path: Path, frames: Iterable[Frame], look: Look, *, title: str, fps: float, hold: float
) -> None:
    """Write the frames of consecutive steps as a smooth `Film`; `fps` is in steps per second.

    The frames are taken after all checks; see `write_pictures`.
    """
    from DroneSwarmSearch.rendering.film import Film

    per_step = max(1, round(SMOOTH / fps))

    def pictures() -> Iterator[NDArray[np.uint8]]:
        played = list(frames)
        film = Film(played, look, title=title)
        yield film.pixels(played[0])
        for frame, following in itertools.pairwise(played):
            for part in range(1, per_step):
                yield film.pixels(frame, towards=following, progress=part / per_step)
            yield film.pixels(following)

    write_pictures(path, pictures(), fps=fps * per_step, hold=hold)


def write_pictures(
    path: Path, pictures: Iterable[NDArray[np.uint8]], *, fps: float, hold: float
) -> None:
    """Write one or more pictures of shape (height, width, 3) to a file, GIF or MP4 by its suffix.

    The last one stays for `hold` additional seconds. The file appears when it is complete; after an
    error, a previous file is still there. Memory does not grow with the number of pictures.

    Raises ImportError without imageio-ffmpeg (the extra "video"), OSError if the file cannot be
    written, and ValueError if the suffix is not one of `SUFFIXES`.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise ValueError(f"path must end in {' or '.join(SUFFIXES)}, got {str(path)!r:.100}")
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
