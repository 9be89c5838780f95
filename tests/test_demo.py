"""The demo: in the terminal, in a window, with manual control, and as a video."""

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from helpers import refusal

from DroneSwarmSearch import Ending, Scale, cli
from DroneSwarmSearch.commands import play as demo
from DroneSwarmSearch.core import Frame
from DroneSwarmSearch.evaluation import evaluate
from DroneSwarmSearch.incident import Incident
from DroneSwarmSearch.rendering.painter import Painter
from DroneSwarmSearch.rendering.player import Player

pygame = pytest.importorskip("pygame")

ROOT = Path(__file__).parent.parent
SEARCH = {
    "grid_size": 9,
    "n_drones": 4,
    "vector": [0.16, 0.08],
    "person_initial_position": [4, 4],
    "disperse_constant": 2,
    "bayesian_update": True,
    "drones_positions": [[0, 0], [8, 0], [8, 8], [0, 8]],
}


@pytest.fixture
def short(tmp_path):
    """The file of a search of 8 steps without a find."""
    return search_file(tmp_path, timestep_limit=8, probability_of_detection=0)


def search_file(folder: Path, **changes: object) -> str:
    """Write the file of a small search, and return its name."""
    path = folder / "mine.json"
    path.write_text(json.dumps(SEARCH | changes))
    return str(path)


def figures(output: str) -> dict[str, str]:
    """The summary at the end of the output, by heading."""
    return dict(re.findall(r"^(\w+(?: \w+)?) {2,}(.+)$", output, re.MULTILINE))


Script = Callable[[Player], Iterator[str]]


def perform(monkeypatch: pytest.MonkeyPatch, script: Script) -> list[Frame]:
    """Let a script press keys in the window, without waiting for the clock.

    It yields names of keys, each pressed before the next picture; "" waits for it. The window is
    closed after the last one. Returns the frames as they are drawn, each once in a row.
    """
    shown: list[Frame] = []
    pressed: dict[Player, Iterator[str]] = {}
    advance = Player.advance
    paint = Painter.paint

    class Clock:
        def tick(self, fps: float) -> int:
            time.sleep(0.001)  # for the thread that plays ahead
            return 1000

    def advance_and_press(player: Player, seconds: float) -> None:
        advance(player, seconds)
        key = next(pressed.setdefault(player, script(player)), None)
        if key is None:
            pygame.event.post(pygame.event.Event(pygame.QUIT))
        elif key:
            code = pygame.key.key_code(key)
            for kind in (pygame.KEYDOWN, pygame.KEYUP):
                pygame.event.post(pygame.event.Event(kind, key=code, unicode="", mod=0))

    def paint_and_note(painter: Painter, frame: Frame, **moment: Any) -> Any:
        if not (shown and shown[-1] is frame):
            shown.append(frame)
        return paint(painter, frame, **moment)

    monkeypatch.setattr(pygame.display, "get_driver", lambda: "visible")
    monkeypatch.setattr(pygame.time, "Clock", Clock)
    monkeypatch.setattr(Player, "advance", advance_and_press)
    monkeypatch.setattr(Painter, "paint", paint_and_note)
    return shown


def watch(player: Player) -> Iterator[str]:
    """Wait for the end."""
    while not player.is_at_end:
        yield ""
    yield ""


def keys(*names: str) -> Script:
    """Press keys, wait for a flight to end, and close the window."""

    def script(player: Player) -> Iterator[str]:
        for name in names:
            yield name
            yield ""
        yield from [""] * 30

    return script


class TestText:
    @pytest.mark.thorough
    def test_without_a_display_it_plays_in_the_terminal(self):
        done = subprocess.run(
            [sys.executable, "-W", "error", "basic_env.py"],
            env={**os.environ, "SDL_VIDEODRIVER": "none_such", "PYTHONPATH": str(ROOT)},
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0
        assert re.fullmatch(
            r"no window can be opened \(.*none_such.*\): showing text\n", done.stderr
        )
        assert "minute 0/30 " in done.stdout
        assert "The person was found" in figures(done.stdout)["outcome"]

    def test_summary(self, short, capsys):
        assert cli.main(["play", short, "--text"]) == 0
        output = capsys.readouterr().out
        assert output.startswith("mine: Read from a file.\n\nstep 0/8 ")
        summary = figures(output)
        assert summary["search"] == "mine, seed 0"
        assert summary["outcome"] == "The person was not found (the time limit was reached)"
        assert summary["return"] == "-400,000.0 (sum over the drones)"
        assert summary["steps"] == "8 of at most 8"
        assert summary["persons found"] == "0 of 1"

    def test_missing_persons_can_be_hidden(self, capsys):
        shown = []
        for hide in ([], ["--hide-person"]):
            cli.main(["play", "harbour", "--text", *hide])
            output = capsys.readouterr().out
            shown.append([bool(re.search(mark + "[.:;=o%#@]", output)) for mark in (" P", r"F\d")])
        assert shown == [[True, True], [False, True]]

    @pytest.mark.thorough
    def test_prints_some_frames_of_a_long_search(self, tmp_path, capsys):
        path = search_file(tmp_path, timestep_limit=1000, probability_of_detection=0)
        cli.main(["play", path, "--text"])
        steps = re.findall(r"step (\d+)/1000", capsys.readouterr().out)
        assert steps == ["0", "200", "400", "600", "800", "1000"]

    def test_draws_in_place_on_a_terminal(self, short, capsys, monkeypatch):
        monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
        monkeypatch.setattr("shutil.get_terminal_size", lambda: os.terminal_size((30, 9)))
        cli.main(["play", short, "--text", "--fps", "50"])
        pictures = capsys.readouterr().out.partition("\n\n")[2].split("\x1b[8A\x1b[J")
        assert [re.search(r"step (\d+)/8", each)[1] for each in pictures] == list("012345678")
        for each in pictures[:-1]:
            lines = each.splitlines()
            assert len(lines) == 8
            assert max(map(len, lines)) <= 30

    @pytest.mark.skipif(sys.platform == "win32", reason="the system does not name this error")
    def test_a_closed_output_pipe_ends_the_demo_quietly(self):
        command = [sys.executable, "-m", "DroneSwarmSearch", "--text"]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        with subprocess.Popen(command, cwd=ROOT, **pipes) as process:
            process.stdout.close()
            assert process.stderr.read() == b""
            assert process.wait(timeout=60) == 1


class TestOptions:
    @pytest.mark.parametrize(
        ("arguments", "problem"),
        [
            ("--fps 0", "--fps must be a finite number of at least 0.1 and at most 50.0, got 0.0"),
            ("--palette red", "argument --palette: invalid choice: 'red'"),
            ("--manual", "argument --text: not allowed with argument --manual"),
        ],
    )
    def test_bad_values(self, capsys, arguments, problem):
        assert problem in refusal(capsys, "play", *arguments.split(), "--text")

    def test_a_search_of_the_suite(self, capsys):
        arguments = ["play", "pond", "--text", "--policy", "greedy-posterior", "--seed", "3"]
        assert cli.main(arguments) == 0
        summary = figures(capsys.readouterr().out)
        assert summary["search"] == "pond, seed 3"
        assert summary["policy"] == "greedy-posterior"
        (pond,) = evaluate("greedy-posterior", "pond", episodes=1, seed=3).episodes.steps
        assert summary["steps"] == f"{pond} of at most 40"

    def test_an_incident(self, tmp_path, capsys):
        incident = Incident(
            position=(54.18, 7.85),
            time="2026-03-01T05:30Z",
            object_class="PIW-1",
            wind=(8, 4),
            endurance=1500,
        )
        incident.write(tmp_path / "raft.json")
        assert cli.main(["play", str(tmp_path / "raft.json"), "--text"]) == 0
        captured = capsys.readouterr()
        assert captured.err == ""
        story = " ".join(captured.out.split("\n\n")[0].split())
        assert story.startswith("raft: Person in water, unknown state (PIW-1) at 54°10.8'N 007°51.")
        assert story.endswith("wind from 243° 17 kn (8.9 m/s); 3 drones from 06:30.")
        summary = figures(captured.out)
        metres, seconds = re.findall(r"[\d.]+", summary["scale"])
        assert float(metres) == pytest.approx(2 * 20 * float(seconds), rel=0.01)

    def test_the_coverage_mission(self, tmp_path, capsys):
        assert cli.main(["play", search_file(tmp_path, mission="coverage"), "--text"]) == 0
        summary = figures(capsys.readouterr().out)
        success = summary["POS"].removesuffix(" of all persons would be found by now")
        assert summary["outcome"].startswith(f"Probability of success {success} (the time limit")
        assert "persons found" not in summary


@pytest.mark.usefixtures("dummy_display")
class TestWindow:
    def test_it_plays_to_the_end_and_stays_open(self, capsys, monkeypatch):
        def script(player: Player) -> Iterator[str]:
            yield from watch(player)
            for _ in range(50):
                assert pygame.display.get_surface() is not None
                yield ""
            yield "return"
            raise AssertionError("Enter closes the window at the end")

        shown = perform(monkeypatch, script)
        assert cli.main(["play", "--fps", "50"]) == 0
        assert "The person was found" in figures(capsys.readouterr().out)["outcome"]
        assert not pygame.display.get_init()
        assert shown[-1].ending is Ending.FOUND

    def test_the_prior_beside_the_posterior(self, monkeypatch):
        sizes = []

        def script(player: Player) -> Iterator[str]:
            for key in ("", "p", "p"):
                yield key
                yield ""
                surface = pygame.display.get_surface()
                sizes.append(surface and surface.get_size())

        perform(monkeypatch, script)
        assert cli.main(["play", "pond"]) == 0
        assert sizes[1] > sizes[0] == sizes[2]

    def test_the_reason_of_a_search_at_sea_is_below_the_map(self, tmp_path, monkeypatch):
        heights = []

        def script(player: Player) -> Iterator[str]:
            yield ""
            heights.append(pygame.display.get_surface().get_height())

        shown = perform(monkeypatch, script)
        monkeypatch.setattr(pygame.display, "get_desktop_sizes", lambda: [(1920, 1080)])
        for scale in (None, {"metres_per_cell": 150, "seconds_per_step": 10}):
            cli.main(["play", search_file(tmp_path, reason="A swimmer is missing.", scale=scale)])
        assert {frame.scale for frame in shown} == {None, Scale(150, 10)}
        assert heights[1] > heights[0]

    @pytest.mark.thorough
    def test_the_next_seed_is_that_of_the_option(self, capsys, monkeypatch):
        def script(player: Player) -> Iterator[str]:
            yield from watch(player)
            yield "n"
            yield from watch(player)

        shown = perform(monkeypatch, script)
        assert cli.main(["play", "--fps", "50", "--seed", "4"]) == 0
        _, *reports = capsys.readouterr().out.split("\n\n")
        assert [figures(each)["search"][-6:] for each in reports] == ["seed 4", "seed 5"]
        cli.main(["play", "--text", "--seed", "5"])
        assert figures(reports[1])["steps"] == figures(capsys.readouterr().out)["steps"]
        assert shown[-1].step == int(figures(reports[1])["steps"].split()[0])

    def test_an_interrupt(self, capsys, monkeypatch):
        def script(player: Player) -> Iterator[str]:
            yield ""
            raise KeyboardInterrupt

        perform(monkeypatch, script)
        assert cli.main(["play"]) == 130
        assert capsys.readouterr().err == "interrupted\n"
        assert not pygame.display.get_init()


@pytest.mark.usefixtures("dummy_display")
class TestManual:
    def test_keys_fly_drone_0(self, tmp_path, capsys, monkeypatch):
        shown = perform(monkeypatch, keys("right", "s", "space", "i", ".", "left", "w", "left"))
        assert cli.main(["play", search_file(tmp_path), "--manual"]) == 0
        path = [frame.drones[0] for frame in shown]
        assert path == [(0, 0), (1, 0), *[(1, 1)] * 4, (0, 1), (0, 0)]
        assert [frame.searching[0] for frame in shown].index(True) == 3
        assert {frame.flown for frame in shown} == {0}
        assert shown[-1].ending is None, "the last key leads out of the grid, so it is refused"
        assert shown[-1].drones[1] != shown[0].drones[1], "the policy flies the others"
        summary = figures(capsys.readouterr().out)
        assert summary["policy"] == "you fly drone 0, greedy-matrix the others"
        assert summary["outcome"] == "stopped: the window was closed"

    def test_the_other_drones_avoid_drone_0(self, tmp_path, monkeypatch):
        shown = perform(monkeypatch, keys(*["right", "i", "left", "down", "i", "up"] * 4))
        crowd = {"grid_size": 4, "n_drones": 6, "drones_positions": [], "timestep_limit": 20}
        start = {"person_initial_position": [2, 2], "probability_of_detection": 0}
        cli.main(["play", "--manual", search_file(tmp_path, **crowd, **start)])
        assert {frame.ending for frame in shown} == {None, Ending.TIME_LIMIT}

    def test_a_game_against_the_policies(self, tmp_path, capsys, monkeypatch):
        path = search_file(tmp_path, timestep_limit=40)
        results = {}
        widths = []
        monkeypatch.setattr(pygame.display, "get_desktop_sizes", lambda: [(1920, 1080)])

        def script(player: Player) -> Iterator[str]:
            widths.append(pygame.display.get_surface().get_width())
            yield from keys(*["space"] * 40)(player)
            results.update((name, last.step) for name, last in player.recording.scores)
            widths.append(pygame.display.get_surface().get_width())

        shown = perform(monkeypatch, script)
        assert cli.main(["play", path, "--manual", "--hide-person"]) == 0
        assert {frame.hide_persons for frame in shown if frame.ending is None} == {True}
        assert shown[-1].hide_persons is False
        capsys.readouterr()
        assert widths[1] > widths[0], "the results stand beside the map"
        assert set(results) == {"you (drone 0)", *demo.RIVALS}
        for policy in demo.RIVALS:
            assert cli.main(["play", path, "--text", "--policy", policy]) == 0
            steps = figures(capsys.readouterr().out)["steps"].split()[0]
            assert results[policy] == int(steps)


class TestVideo:
    def test_gif(self, short, tmp_path, capsys):
        image = pytest.importorskip("PIL.Image")
        video = tmp_path / "search.gif"
        assert cli.main(["play", short, "--record", str(video), "--fps", "10"]) == 0
        assert "POS" in figures(capsys.readouterr().out)
        with image.open(video) as gif:
            assert 450 < gif.width < 500
            assert gif.n_frames > 8
        assert video.stat().st_size < 250_000
