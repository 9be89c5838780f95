"""Videos of one episode, complete or not written."""

from __future__ import annotations

import base64
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from DroneSwarmSearch import Person, RewardScheme
from DroneSwarmSearch import cli as command
from DroneSwarmSearch.drift import Drift, ProbabilityMatrix, dispersion_rate
from DroneSwarmSearch.drift.belief import Belief
from DroneSwarmSearch.evaluation import NamedSearch, Video, evaluate, record, recording
from DroneSwarmSearch.evaluation.recording import frames
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rendering.labels import outcome_in_brief
from DroneSwarmSearch.rendering.palette import NOT_FOUND
from DroneSwarmSearch.rendering.video import SUFFIXES, pictures_per_step, write_video
from DroneSwarmSearch.rules import Action, Ending
from DroneSwarmSearch.scenario import Scenario

pytest.importorskip("pygame")
Image = pytest.importorskip("PIL.Image")
imageio = pytest.importorskip("imageio.v2")

from DroneSwarmSearch.rendering.painter import HEAD, Painter  # noqa: E402 (needs pygame)


def small(**changed: Any) -> NamedSearch:
    """A short search."""
    parameters: dict[str, Any] = {
        "grid_size": 5,
        "n_drones": 2,
        "vector": (0.3, 0.0),
        "person_initial_position": (1, 2),
        "disperse_constant": 3,
        "timestep_limit": 8,
        "probability_of_detection": 1.0,
        "bayesian_update": False,
        "reward_scheme": RewardScheme(),
    }
    return NamedSearch("puddle", "For tests.", Scenario(**{**parameters, **changed}))


def at_sea(**changed: Any) -> NamedSearch:
    """A short search for a person with two hypotheses."""
    person = Person(
        [
            Drift((4, 4), start_sd=1, vector=(0.05, 0), vector_sd=0.02, weight=3),
            Drift((10, 10), start_sd=1, vector=(0, 0.05), diffusion=0.1),
        ],
        probability_of_detection=0.5,
    )
    parameters = {"grid_size": 15, "n_drones": 3, "timestep_limit": 20, "persons": person}
    return NamedSearch("storm", "For tests.", Scenario(**{**parameters, **changed}))


def all_do(action: Action) -> Any:
    """A policy with one action."""

    def policy(observations: Mapping[str, Any]) -> dict[str, int]:
        return dict.fromkeys(observations, int(action))

    return policy


class Watcher:
    """Idles, and records its observations and seeds."""

    def __init__(self) -> None:
        self.shown: list[NDArray[np.float32]] = []
        self.seeds: list[object] = []

    def reset(self, seed: object = None, rows: object = None) -> None:
        self.seeds.append(seed)

    def __call__(self, observations: Mapping[str, Any]) -> dict[str, int]:
        self.shown.append(observations["drone0"]["observation"][1])
        return dict.fromkeys(observations, int(Action.IDLE))


class TestFrames:
    def test_both_halves_show_the_same_episode(self) -> None:
        search = small(timestep_limit=30, n_drones=1, vector=(0.0, 0.0), disperse_constant=1)
        pairs = list(frames("greedy-posterior", search, seed=4))
        for prior, posterior in pairs:
            same = replace(
                posterior,
                matrix=prior.matrix,
                probability_of_success=None,
                hypotheses=prior.hypotheses,
                prior=None,
            )
            assert vars(same) == vars(prior)
            assert posterior.hypotheses == (pytest.approx((1.0,)),)
        forecast = ProbabilityMatrix(5, Drift((1, 2), diffusion=dispersion_rate(1)))
        belief = Belief(forecast, 1.0, forecast.joint(0))
        for (_, before), (prior, after) in pairwise(pairs):
            looked = [cell for cell, s in zip(before.drones, after.searching, strict=True) if s]
            if looked and not any(after.found):
                belief = belief.after_search([y * 5 + x for x, y in looked])
            belief = belief.after_drift(before.step)
            assert np.array_equal(prior.matrix, forecast.at(after.step))
            if not any(after.found):
                np.testing.assert_allclose(after.matrix, belief.map(), atol=1e-6)
        assert any(after.searching[0] for _, after in pairs)

    @pytest.mark.parametrize("mission", ["rescue", "coverage"])
    def test_uncertain_persons(self, mission: str) -> None:
        search = at_sea(mission=mission)
        *_, (prior, posterior) = pairs = list(frames("greedy-posterior", search, seed=1))
        assert all(before.hypotheses == ((0.75, 0.25),) for before, _ in pairs)
        assert posterior.hypotheses != prior.hypotheses
        assert sum(posterior.hypotheses[0]) == pytest.approx(1)
        found = [after.probability_of_success for _, after in pairs]
        assert found[0] == 0
        assert found == sorted(found)
        assert found[-1] > 0.1
        assert (prior.persons == ()) == (mission == "coverage")

    @pytest.mark.parametrize("policy", ["random", "greedy-posterior", "parallel-sweep"])
    def test_it_is_the_episode_that_evaluate_plays_with_the_seed(self, policy: str) -> None:
        search = small(timestep_limit=25)
        episodes = evaluate(policy, search, episodes=3, seed=5, progress=False).episodes
        for place, seed in enumerate((5, 6, 7)):
            *_, (_, last) = frames(policy, search, seed=seed)
            assert last.step == episodes.steps[place]
            assert any(last.found) == bool(episodes.found_at[place, 0])

    @pytest.mark.parametrize("updates", [False, True])
    def test_the_policy_sees_the_prior_or_the_posterior(self, updates: bool) -> None:
        for search, asked in ((small(bayesian_update=updates), None), (small(), updates)):
            watcher = Watcher()
            pairs = list(frames(watcher, search, seed=3, bayesian_update=asked))
            for shown, pair in zip(watcher.shown, pairs, strict=False):
                assert np.array_equal(shown, pair[updates].matrix)
            assert watcher.seeds == [3]

    def test_bad_input_is_refused(self) -> None:
        with pytest.raises(ValueError, match=r"got 'pnd'; did you mean pond?"):
            frames("random", "pnd")
        with pytest.raises(ValueError, match=r"policy must be one of random"):
            frames("greedy", "pond")
        with pytest.raises(TypeError, match="path must be the path of a file, got None"):
            record("random", "pond", None)
        with pytest.raises(ValueError, match=r"seed must be an integer of at least 0, got -1"):
            frames("random", "pond", seed=-1)
        with pytest.raises(TypeError, match=r"bayesian_update must be True or False, got 1"):
            frames("random", "pond", bayesian_update=1)  # type: ignore[arg-type]

    def test_bad_input_makes_no_folder(self, tmp_path: Path) -> None:
        with pytest.raises(ValueError, match="policy must be one of random"):
            record("greedy", "pond", tmp_path / "videos" / "search.gif")
        assert not any(tmp_path.iterdir())


class TestPicture:
    def test_a_long_title_fits(self) -> None:
        title = "a_package_with_a_name.and_a_module_with_another:AndAPolicyThatIsNamedToo"
        ended = replace(frame(6), ending=Ending.COLLISION)
        painter = Painter(6, view="both")
        picture = painter.pixels(replace(ended, policy=f"{title} searching wreck, seed 123456"))
        changed = (picture != painter.pixels(replace(ended, policy="short")))[:HEAD]
        outcome = np.flatnonzero((picture[:HEAD] == NOT_FOUND).all(axis=2).any(axis=0))
        assert len(outcome) > 300
        title_end = np.flatnonzero(changed[:, : outcome.min()].any(axis=(0, 2))).max()
        assert 0.9 * outcome.min() < title_end < outcome.min()

    @pytest.mark.parametrize(
        ("ending", "step", "words"),
        [
            (None, 3, ""),
            (Ending.FOUND, 1, "found in 1 step"),
            (Ending.FOUND, 12, "found in 12 steps"),
            (Ending.TIME_LIMIT, 100, "not found in 100 steps"),
            (Ending.COLLISION, 4, "drones collided in step 4"),
            (Ending.LEFT_GRID, 5, "a drone left the grid in step 5"),
        ],
    )
    def test_the_outcome_is_shown(self, ending: Ending | None, step: int, words: str) -> None:
        assert outcome_in_brief(replace(frame(6), ending=ending, step=step)) == words


class TestVideo:
    def test_a_gif_has_a_picture_for_each_step(self, tmp_path: Path) -> None:
        path = tmp_path / "video.gif"
        made = record(all_do(Action.IDLE), small(), path, name="lazy")
        assert made.path == path
        assert (made.last.step, made.last.ending) == (8, Ending.TIME_LIMIT)
        with Image.open(path) as video:
            # Equal pictures are kept as one that stays longer.
            assert 1 < video.n_frames <= 9 * pictures_per_step(recording.FPS)
            assert video.width == recording.GIF_WIDTH
        assert list(tmp_path.iterdir()) == [path]

    def test_a_video_holds_the_last_picture(self, tmp_path: Path) -> None:
        pytest.importorskip("imageio_ffmpeg")
        path = tmp_path / "video.mp4"
        record(all_do(Action.IDLE), small(timestep_limit=3), path, fps=2.0)
        with imageio.get_reader(path) as video:
            rate = 2 * pictures_per_step(2.0)
            assert 20 <= rate <= 30
            assert video.get_meta_data()["fps"] == rate
            assert video.count_frames() == 1 + 3 * rate // 2 + round(rate * recording.HOLD)
            assert video.get_data(0).shape == Painter(5, view="both").pixels(frame(5)).shape

    @pytest.mark.parametrize(
        ("name", "tag", "kind"), [("a.GIF", "img", "image/gif"), ("a.mp4", "video", "video/mp4")]
    )
    def test_a_notebook_shows_the_video(
        self, name: str, tag: str, kind: str, tmp_path: Path
    ) -> None:
        path = tmp_path / name
        path.write_bytes(b"the video")
        html = Video(path, frame(5))._repr_html_()
        assert html.startswith(f"<{tag} ")
        assert f'src="data:{kind};base64,{base64.b64encode(b"the video").decode()}"' in html

    def test_an_existing_file_is_kept_if_the_policy_fails(self, tmp_path: Path) -> None:
        path = tmp_path / "video.gif"
        path.write_bytes(b"before")

        def failing(observations: Mapping[str, Any]) -> dict[str, int]:
            raise RuntimeError("no idea")

        with pytest.raises(RuntimeError, match="no idea"):
            record(failing, small(), path)
        assert path.read_bytes() == b"before"
        assert list(tmp_path.iterdir()) == [path]

    @pytest.mark.parametrize(
        ("changed", "words"),
        [
            ({"path": "video.avi"}, r"path must end in \.gif or \.mp4, got 'video\.avi'"),
            ({"fps": 0}, r"fps must be a finite number of at least 0\.1 and at most 50\.0, got 0"),
            ({"seed": -1}, r"seed must be an integer of at least 0, got -1"),
        ],
    )
    def test_bad_input_is_refused(
        self, changed: dict[str, Any], words: str, tmp_path: Path
    ) -> None:
        arguments = {"path": "video.gif", **changed}
        path = tmp_path / arguments.pop("path")
        with pytest.raises(ValueError, match=words.replace("'video", ".*video")):
            record("random", small(), path, **arguments)
        assert not list(tmp_path.iterdir())


class StoppedError(BaseException):
    """What no library expects."""


class TestWriting:
    """`write_video`, on which the commands rest."""

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
    def path(self, request: pytest.FixtureRequest, tmp_path: Path) -> Path:
        """Where a video is already."""
        if request.param == ".mp4":
            pytest.importorskip("imageio_ffmpeg")
        path = tmp_path / f"video{request.param}"
        path.write_bytes(b"before")
        return path

    @pytest.mark.parametrize("suffix", SUFFIXES)
    def test_any_name_will_do(
        self, suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        if suffix == ".mp4":
            pytest.importorskip("imageio_ffmpeg")
        monkeypatch.chdir(tmp_path)
        path = Path(f"a:b -y%d{suffix}")
        assert write_video(path, self.pictures(3), fps=5, hold=0) == 3
        assert path.stat().st_size > 100 and len(list(tmp_path.iterdir())) == 1

    @pytest.mark.parametrize(
        ("changes", "error", "message"),
        [
            ({"fps": 0}, ValueError, "fps must be .* got 0"),
            ({"fps": -1}, ValueError, "fps must be .* got -1"),
            ({"fps": float("nan")}, ValueError, "fps must be"),
            ({"hold": -9}, ValueError, "hold must be .* got -9"),
            ({"hold": "1"}, TypeError, "hold must be"),
            ({"gif_width": 0}, ValueError, "gif_width must be"),
            ({"path": "video.gif"}, TypeError, "path must be"),
        ],
    )
    def test_bad_arguments_are_refused_before_the_first_picture(
        self, path: Path, changes: dict[str, Any], error: type[Exception], message: str
    ) -> None:
        taken: list[int] = []
        pictures = (taken.append(1) or each for each in self.pictures(3))
        given: dict[str, Any] = {"path": path, "fps": 5, "hold": 1, **changes}
        with pytest.raises(error, match=message):
            write_video(given.pop("path"), pictures, **given)
        assert not taken and path.read_bytes() == b"before"

    @pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError, MemoryError, StoppedError])
    @pytest.mark.parametrize("place", [0, 1, 29])
    def test_an_error_keeps_the_existing_video(
        self, path: Path, error: type[BaseException], place: int
    ) -> None:
        def failing() -> Iterator[NDArray[np.uint8]]:
            yield from self.pictures(place, 200, 300)
            raise error

        with pytest.raises(error):
            write_video(path, failing(), fps=5, hold=1)
        assert path.read_bytes() == b"before"
        assert list(path.parent.iterdir()) == [path]

    @pytest.mark.skipif(sys.platform == "win32", reason="limits of a process are POSIX's")
    @pytest.mark.parametrize("room", [0, 1000, 20_000])
    def test_a_full_disk_keeps_the_existing_video(self, path: Path, room: int) -> None:
        resource = pytest.importorskip("resource")
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))
        try:
            with pytest.raises(OSError, match="files written before are kept") as caught:
                write_video(path, self.pictures(30, 200, 300), fps=5, hold=1)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
        assert str(path) in str(caught.value)
        assert path.read_bytes() == b"before"
        assert list(path.parent.iterdir()) == [path]

    @pytest.mark.skipif(sys.platform == "win32", reason="the module resource is POSIX's")
    def test_memory_does_not_grow_with_the_number_of_pictures(self, path: Path) -> None:
        code = (
            "import resource, sys\n"
            "from pathlib import Path\n"
            "import numpy as np\n"
            "from DroneSwarmSearch.rendering.video import write_video\n"
            "def pictures(count):\n"
            "    picture = np.random.default_rng(0).integers(0, 256, (300, 400, 3), np.uint8)\n"
            "    for row in range(count):\n"
            "        picture = picture.copy()\n"
            "        picture[row] = 255\n"
            "        yield picture\n"
            "def most(count):\n"
            "    write_video(Path(sys.argv[1]), pictures(count), fps=5, hold=1)\n"
            "    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
            "few = most(10)\n"
            "print(most(50) - few)\n"
        )
        unit = 1 if sys.platform == "darwin" else 1024
        assert int(python(code, path)) * unit < 6_000_000  # 40 pictures have 14 million bytes

    def test_a_gif_shows_every_picture_for_its_time(self, tmp_path: Path) -> None:
        path = tmp_path / "video.gif"
        ramp = np.zeros((40, 50, 3), np.uint8)
        pictures = [ramp]
        for box in [(0, 0, 5, 5), (39, 49, 40, 50), None, None, (0, 0, 40, 50), (3, 4, 20, 5)]:
            picture = pictures[-1].copy()
            if box is not None:
                top, left, bottom, right = box
                picture[top:bottom, left:right] ^= 255
            pictures.append(picture)
        assert write_video(path, iter(pictures), fps=4, hold=1.5) == 7
        shown, durations = [], []
        with Image.open(path) as video:
            assert video.info["loop"] == 0
            for number in range(video.n_frames):
                video.seek(number)
                shown.append(np.asarray(video.convert("RGB")))
                durations.append(video.info["duration"])
        assert durations == [250, 250, 750, 250, 1750]
        for seen, wanted in zip(shown, [0, 1, 2, 5, 6], strict=True):
            assert np.abs(seen.astype(int) - pictures[wanted]).max() <= 8

    @pytest.mark.parametrize("fps", [7, 16.7, 26, 28, 33, 49])
    def test_a_gif_is_as_fast_as_asked(self, tmp_path: Path, fps: float) -> None:
        path = tmp_path / "video.gif"
        pictures = [np.full((2, 2, 3), 200 * (number % 2), np.uint8) for number in range(100)]
        write_video(path, pictures, fps=fps, hold=0)
        total = 0
        with Image.open(path) as video:
            for number in range(video.n_frames):
                video.seek(number)
                total += video.info["duration"]
                assert video.info["duration"] >= 20  # browsers slow shorter delays down
        assert total == pytest.approx(100_000 / fps, abs=10)

    def test_a_picture_that_stays_too_long_for_a_gif_is_repeated(self, tmp_path: Path) -> None:
        path = tmp_path / "video.gif"
        same = np.full((20, 30, 3), 77, np.uint8)
        assert write_video(path, [same] * 100, fps=0.1, hold=3) == 100
        total = 0
        with Image.open(path) as video:
            for number in range(video.n_frames):
                video.seek(number)
                total += video.info["duration"]
        assert video.n_frames == 2
        assert total == 1_003_000

    def test_a_video_of_odd_lengths(self, tmp_path: Path) -> None:
        pytest.importorskip("imageio_ffmpeg")
        path = tmp_path / "video.mp4"
        assert write_video(path, self.pictures(4, 61, 83), fps=4, hold=1) == 4
        with imageio.get_reader(path) as video:
            assert video.count_frames() == 8
            assert video.get_data(0).shape == (62, 84, 3)

    @pytest.mark.parametrize(
        ("pictures", "words"),
        [
            ([], "pictures must be at least one, got none"),
            ([np.zeros((4, 4), np.uint8)], r"got uint8 of shape \(4, 4\)"),
            ([np.zeros((4, 4, 3), np.float32)], r"got float32 of shape \(4, 4, 3\)"),
            (
                [np.zeros((4, 4, 3), np.uint8), np.zeros((6, 4, 3), np.uint8)],
                r"got uint8 of shape \(6, 4, 3\) after \(4, 4, 3\)",
            ),
        ],
    )
    def test_bad_pictures_are_refused(
        self, path: Path, pictures: list[NDArray[Any]], words: str
    ) -> None:
        with pytest.raises(ValueError, match=words):
            write_video(path, pictures, fps=5, hold=1)
        assert path.read_bytes() == b"before"

    @pytest.mark.parametrize("suffix", SUFFIXES)
    def test_a_folder_in_the_way_is_named_before_the_first_picture(
        self, tmp_path: Path, suffix: str
    ) -> None:
        path = tmp_path / f"video{suffix}"
        path.mkdir()
        with pytest.raises(IsADirectoryError):
            write_video(path, untouchable(), fps=5, hold=1)

    @pytest.mark.parametrize(("suffix", "missing"), [(".gif", "PIL"), (".mp4", "imageio_ffmpeg")])
    def test_a_missing_package_is_named_before_the_first_picture(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, missing: str
    ) -> None:
        monkeypatch.setitem(sys.modules, missing, None)
        with pytest.raises(ImportError, match=rf"needs the package {missing}: pip install .*video"):
            write_video(tmp_path / f"video{suffix}", untouchable(), fps=5, hold=1)
        assert not list(tmp_path.iterdir())

    @pytest.mark.parametrize("program", ["nowhere", "folder", "text", ""])
    def test_a_missing_ffmpeg_is_named_before_the_first_picture(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, program: str
    ) -> None:
        ffmpeg = pytest.importorskip("imageio_ffmpeg")
        (tmp_path / "folder").mkdir()
        (tmp_path / "text").write_text("no program")
        monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(tmp_path / program) if program else "")
        if not program:
            monkeypatch.setattr(ffmpeg._utils, "_get_ffmpeg_exe", lambda: None)
        before = sorted(tmp_path.iterdir())
        with pytest.raises(ImportError, match=r"needs the program ffmpeg.*imageio-ffmpeg"):
            write_video(tmp_path / "video.mp4", untouchable(), fps=5, hold=1)
        assert sorted(tmp_path.iterdir()) == before


def untouchable() -> Iterator[NDArray[np.uint8]]:
    """Pictures of which none may be taken."""
    pytest.fail("an episode was begun")
    yield


def python(code: str, *arguments: object) -> str:
    """What some code prints in a process of its own."""
    here = Path(__file__).parent
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(here), str(here.parent)])},
    )
    return done.stdout


class TestCommand:
    @pytest.mark.parametrize("mission", ["rescue", "coverage"])
    def test_it_records_uncertain_persons(
        self, mission: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        search = at_sea(mission=mission)
        file, path = tmp_path / "storm.json", tmp_path / "storm.gif"
        file.write_text(json.dumps(search.data), "utf-8")
        arguments = ["record", str(file), "--policy", "greedy-posterior", "--out", str(path)]
        assert command.main(arguments) == 0
        pairs = list(frames("greedy-posterior", search))
        outcome = outcome_in_brief(pairs[-1][1])
        captured = capsys.readouterr()
        assert captured.out == f"{path}: greedy-posterior searching storm, {outcome}\n"
        assert captured.err == ""
        with Image.open(path) as video:
            assert len(pairs) < video.n_frames <= len(pairs) * pictures_per_step(recording.FPS)

    def test_it_writes_the_video_and_prints_the_outcome(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        path = tmp_path / "pond.gif"
        arguments = ["record", "pond", "--policy", "greedy-posterior", "--seed", "3"]
        assert command.main([*arguments, "--out", str(path)]) == 0
        *_, (_, last) = frames("greedy-posterior", "pond", seed=3)
        output = f"{path}: greedy-posterior searching pond, {outcome_in_brief(last)}\n"
        assert capsys.readouterr().out == output
        assert path.stat().st_size > 10_000

    @pytest.mark.parametrize(
        ("arguments", "words"),
        [
            (["pnd", "--out", "a.gif"], "got 'pnd'; did you mean pond?"),
            (["pond", "--policy", "greed", "--out", "a.gif"], "did you mean greedy-"),
            (["pond", "--policy", "random", "--out", "a.png"], "must end in .gif or .mp4"),
            (["pond", "--policy", "random", "--fps", "99", "--out", "a.gif"], "fps must be"),
        ],
    )
    def test_wrong_arguments_are_reported_in_a_line(
        self,
        arguments: list[str],
        words: str,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        monkeypatch.chdir(tmp_path)
        with pytest.raises(SystemExit) as stop:
            command.main(["record", *arguments])
        assert stop.value.code == 2
        output = capsys.readouterr().err
        assert words in output
        assert "Traceback" not in output
        assert not list(tmp_path.iterdir())

    def test_a_file_that_cannot_be_written_is_named(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        blocked = tmp_path / "file"
        blocked.touch()
        path = blocked / "video.gif"
        with pytest.raises(SystemExit) as stop:
            command.main(["record", "pond", "--policy", "random", "--out", str(path)])
        assert stop.value.code == 1
        assert f"cannot write {path}" in capsys.readouterr().err

    def test_missing_packages_are_named(
        self,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        monkeypatch.setitem(sys.modules, "PIL", None)
        with pytest.raises(SystemExit) as stop:
            command.main(
                ["record", "pond", "--policy", "random", "--out", str(tmp_path / "video.gif")]
            )
        assert stop.value.code == 2
        assert 'needs the package PIL: pip install "DroneSwarm' in capsys.readouterr().err
        assert not list(tmp_path.iterdir())

    def test_a_missing_ffmpeg_is_reported_in_a_line(
        self,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        pytest.importorskip("imageio_ffmpeg")
        monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(tmp_path / "nowhere"))
        with pytest.raises(SystemExit) as stop:
            command.main(
                ["record", "pond", "--policy", "random", "--out", str(tmp_path / "video.mp4")]
            )
        assert stop.value.code == 2
        output = capsys.readouterr().err
        assert "needs the program ffmpeg" in output
        assert "Traceback" not in output
        assert not list(tmp_path.iterdir())

    def test_an_interruption_leaves_no_file(
        self,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        def interrupted(*_: object, **__: object) -> int:
            raise KeyboardInterrupt

        monkeypatch.setattr(recording, "write_video", interrupted)
        out = str(tmp_path / "video.gif")
        assert command.main(["record", "pond", "--policy", "random", "--out", out]) == 130
        assert "interrupted" in capsys.readouterr().err
        assert not list(tmp_path.iterdir())


def frame(grid_size: int, likeliest: tuple[int, int] | None = None) -> Frame:
    """A frame without news: a flat matrix, or one with a peak."""
    matrix = np.full((grid_size, grid_size), 1.0, np.float32)
    if likeliest is not None:
        matrix[likeliest[::-1]] = 9.0
    return Frame(
        matrix=matrix / matrix.sum(),
        drones=((0, 0),),
        searching=(True,),
        persons=((1, 1),),
        found_by=(None,),
        step=3,
        timestep_limit=10,
        vector=(0.5, -0.25),
        ending=None,
    )
