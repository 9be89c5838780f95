"""Videos of one episode, complete or not written."""

import base64
import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers import make_frame, refusal
from numpy.typing import NDArray

from DroneSwarmSearch import Action, Ending, Scale, Scenario
from DroneSwarmSearch import cli as command
from DroneSwarmSearch.core import Frame
from DroneSwarmSearch.evaluation import NamedSearch, Video, View, evaluate, record, recording
from DroneSwarmSearch.evaluation.recording import play
from DroneSwarmSearch.policies import make
from DroneSwarmSearch.rendering.palette import NOT_FOUND
from DroneSwarmSearch.rendering.video import SUFFIXES, write_pictures

pytest.importorskip("pygame")
Image = pytest.importorskip("PIL.Image")
ffmpeg = pytest.importorskip("imageio_ffmpeg")

from DroneSwarmSearch.rendering.painter import HEAD, Painter  # noqa: E402 (needs pygame)


def small(**changed: Any) -> NamedSearch:
    """A short search."""
    place = {"vector": (0.3, 0.0), "person_initial_position": (1, 2), "disperse_constant": 3}
    scenario = Scenario(5, n_drones=2, **{"timestep_limit": 8, **place, **changed})
    return NamedSearch("puddle", "For tests.", scenario)


class Watcher:
    """Idles, and records its observations and seeds."""

    view = "parallel"

    def __init__(self) -> None:
        self.shown: list[NDArray[np.float32]] = []
        self.seeds: list[object] = []

    def reset(self, seed: object = None, rows: object = None) -> None:
        self.seeds.append(seed)

    def __call__(self, observations: Mapping[str, Any]) -> dict[str, int]:
        self.shown.append(observations["drone0"]["observation"][1])
        return dict.fromkeys(observations, int(Action.IDLE))


def frames(policy: Any, search: NamedSearch, seed: int = 0) -> list[Frame]:
    """The frames of an episode."""
    made = make(policy, search.scenario) if isinstance(policy, str) else policy
    return [frame for frame, _ in play(made, search, seed, View("parallel"))]


class TestFrames:
    @pytest.mark.parametrize("policy", ["random", "greedy-posterior", "parallel-sweep"])
    def test_it_is_the_episode_that_evaluate_plays_with_the_seed(self, policy):
        search = small(timestep_limit=25)
        episodes = evaluate(policy, search, episodes=3, seed=5, progress=False).episodes
        for place, seed in enumerate((5, 6, 7)):
            last = frames(policy, search, seed=seed)[-1]
            assert last.step == episodes.steps[place]
            assert any(last.found) == bool(episodes.found_at[place, 0])

    @pytest.mark.parametrize("updates", [False, True])
    def test_the_policy_sees_the_prior_or_the_posterior(self, updates):
        watcher = Watcher()
        played = frames(watcher, small(bayesian_update=updates), seed=3)
        for shown, frame in zip(watcher.shown, played, strict=False):
            assert np.array_equal(shown, frame.matrix if updates else frame.prior)
        assert watcher.seeds == [3]


class TestPicture:
    def test_a_long_title_fits(self):
        title = "a_package_with_a_name.and_a_module_with_another:AndAPolicyThatIsNamedToo"
        ended = make_frame(6, ending=Ending.COLLISION)
        painter = Painter(6, view="both")
        picture = painter.pixels(replace(ended, policy=f"{title} searching wreck, seed 123456"))
        changed = (picture != painter.pixels(replace(ended, policy="short")))[:HEAD]
        outcome = np.flatnonzero((picture[:HEAD] == NOT_FOUND).all(axis=2).any(axis=0))
        assert len(outcome) > 300
        title_end = np.flatnonzero(changed[:, : outcome.min()].any(axis=(0, 2))).max()
        assert 0.9 * outcome.min() < title_end < outcome.min()


class TestVideo:
    def test_a_gif_has_a_picture_for_each_step(self, tmp_path):
        path = tmp_path / "video.gif"
        made = record(Watcher(), small(), path, name="lazy")
        assert made.path == path
        assert (made.last.step, made.last.ending) == (8, Ending.TIME_LIMIT)
        with Image.open(path) as video:
            assert video.n_frames > 8
            assert 450 < video.width < 500
        assert list(tmp_path.iterdir()) == [path]

    @pytest.mark.parametrize("scale", [None, Scale(150, 10)])
    def test_story_scale_and_palette_are_shown(self, tmp_path, monkeypatch, scale):
        made: dict[str, Any] = {}

        def write(path: Path, frames: Any, look: Any, *, title: str, **timing: float) -> None:
            scales = {frame.scale for frame in frames}
            made.update(title=title, palette=look.palette, scales=scales)

        monkeypatch.setattr(recording, "write_video", write)
        where = replace(small(), scale=scale)
        path = tmp_path / "video.gif"
        record(Watcher(), where, path)
        assert made == {"title": "For tests.", "palette": "sea", "scales": {scale}}
        record(Watcher(), where, path, title="Mine", palette="classic")
        assert (made["title"], made["palette"]) == ("Mine", "classic")
        with pytest.raises(ValueError, match="palette must be one of 'sea', 'classic', got 'red'"):
            record(Watcher(), where, path, palette="red")

    def test_a_video_holds_the_last_picture(self, tmp_path, monkeypatch):
        monkeypatch.setattr(recording, "HOLD", 1.0)
        path = tmp_path / "video.mp4"
        record(Watcher(), small(timestep_limit=3), path, fps=5.0)
        count, seconds = ffmpeg.count_frames_and_secs(str(path))
        assert seconds == pytest.approx(3 / 5 + 1, abs=0.1)
        assert 20 <= count / seconds <= 30

    @pytest.mark.parametrize(
        ("name", "tag", "kind"), [("a.GIF", "img", "image/gif"), ("a.mp4", "video", "video/mp4")]
    )
    def test_a_notebook_shows_the_video(self, name, tag, kind, tmp_path):
        path = tmp_path / name
        path.write_bytes(b"the video")
        html = Video(path, make_frame(5))._repr_html_()
        assert html.startswith(f"<{tag} ")
        assert f'src="data:{kind};base64,{base64.b64encode(b"the video").decode()}"' in html


class TestWriting:
    """`write_pictures`, on which the commands rest."""

    @staticmethod
    def pictures(count: int, height: int = 60, width: int = 80) -> Iterator[NDArray[np.uint8]]:
        """Noise, of which a part changes from picture to picture."""
        rng = np.random.default_rng(0)
        picture = rng.integers(0, 256, (height, width, 3), np.uint8)
        for number in range(count):
            picture = picture.copy()
            picture[number % height, : 1 + number % width] = 255
            yield picture

    @pytest.fixture(params=SUFFIXES)
    def path(self, request, tmp_path):
        """Where a video is already."""
        path = tmp_path / f"video{request.param}"
        path.write_bytes(b"before")
        return path

    @staticmethod
    def write(path: Path, pictures: Any, fps: float = 5, hold: float = 1) -> None:
        write_pictures(path, pictures, fps=fps, hold=hold)

    def test_an_interrupt_keeps_the_existing_video(self, path):
        def failing() -> Iterator[NDArray[np.uint8]]:
            yield from self.pictures(29, 200, 300)
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            self.write(path, failing())
        assert path.read_bytes() == b"before"
        assert list(path.parent.iterdir()) == [path]

    @pytest.mark.skipif(sys.platform == "win32", reason="limits of a process are POSIX's")
    @pytest.mark.parametrize("room", [0, 20_000])
    def test_a_full_disk_keeps_the_existing_video(self, path, room):
        resource = pytest.importorskip("resource")
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))
        try:
            with pytest.raises(OSError, match="files written before are kept") as caught:
                self.write(path, self.pictures(30, 200, 300))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
        assert str(path) in str(caught.value)
        assert path.read_bytes() == b"before"
        assert list(path.parent.iterdir()) == [path]

    @pytest.mark.parametrize("fps", [4, 16.7, 49])
    def test_a_gif_is_as_fast_as_asked(self, tmp_path, fps):
        path = tmp_path / "video.gif"
        pictures = [np.full((20, 30, 3), 200 * (number % 2), np.uint8) for number in range(40)]
        self.write(path, pictures, fps=fps, hold=1.5)
        total = 0
        shown = []
        with Image.open(path) as video:
            assert video.info["loop"] == 0
            for number in range(video.n_frames):
                video.seek(number)
                total += video.info["duration"]
                shown.append(np.asarray(video.convert("RGB")))
        assert total == pytest.approx(40_000 / fps + 1500, abs=1000 / fps)
        for picture, wanted in zip(shown[:40], pictures, strict=True):
            assert np.abs(picture.astype(int) - wanted).max() <= 8


class TestCommand:
    @pytest.mark.parametrize(
        ("arguments", "words"),
        [
            (["all", "--out", "a.gif"], "SEARCH must be one of pond"),
            (["pond", "--out", "a.png"], "must end in .gif or .mp4, got 'a.png'"),
            (["pond", "--fps", "99", "--out", "a.gif"], "fps must be a finite number of at least"),
        ],
    )
    def test_wrong_arguments_are_refused(self, arguments, words, tmp_path, monkeypatch, capsys):
        monkeypatch.chdir(tmp_path)
        assert words in refusal(capsys, "record", "--policy", "random", *arguments)
        assert not list(tmp_path.iterdir())

    def test_a_missing_package_is_named(self, tmp_path, monkeypatch, capsys):
        monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
        monkeypatch.setattr(recording, "play", lambda *_: pytest.fail("an episode was begun"))
        out = str(tmp_path / "video.gif")
        assert command.main(["record", "pond", "--policy", "random", "--out", out]) == 1
        assert 'needs the package imageio_ffmpeg: pip install "Dr' in capsys.readouterr().err
        assert not list(tmp_path.iterdir())
