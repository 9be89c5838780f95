"""The demo: in the terminal, in a window, with manual control, and as a video."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from DroneSwarmSearch import DroneSwarmSearch, Scale, demo, leeway
from DroneSwarmSearch import cli as command_line
from DroneSwarmSearch.evaluation import evaluate
from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.policies import POLICIES
from DroneSwarmSearch.rendering.painter import Painter
from DroneSwarmSearch.rendering.player import Player
from DroneSwarmSearch.rendering.terminal import fitted
from DroneSwarmSearch.rendering.text import render_text
from DroneSwarmSearch.rules import Ending

pygame = pytest.importorskip("pygame")

ROOT = Path(__file__).parent.parent
SHORT = ["--grid-size", "9", "--timestep-limit", "8"]
"""Options of an episode of 8 steps without a find."""
FOUND = ["--grid-size", "9"]
"""Options of an episode with a find, for the default seed."""
INCIDENT = ["--object-class", "PIW-1", "--wind", "240", "20", "--timestep-limit", "12"]
"""Options of a short search for a person in the water."""


def run(*command: str, display: str) -> subprocess.CompletedProcess[str]:
    """Python with some arguments and one video driver for SDL."""
    environment = {**os.environ, "SDL_VIDEODRIVER": display, "PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [sys.executable, "-W", "error", *command],
        env=environment,
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def refusal(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The last line of the demo's error message on invalid arguments."""
    with pytest.raises(SystemExit) as stop:
        demo.main(arguments)
    captured = capsys.readouterr()
    assert stop.value.code == 2
    assert captured.out == ""
    return captured.err.splitlines()[-1]


def figures(output: str) -> dict[str, str]:
    """The summary at the end of the output, by heading."""
    return dict(re.findall(r"^(\w+(?: \w+)?) {2,}(.+)$", output, re.MULTILINE))


@pytest.fixture
def dummy_video(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Select the dummy video driver."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pygame.quit()
    yield
    pygame.quit()


Script = Callable[[Player], Iterator[str]]


def perform(monkeypatch: pytest.MonkeyPatch, script: Script) -> list[Frame]:
    """Let a script press keys in the window, without waiting for the clock.

    The script yields names of keys, each pressed before the next picture; "" waits for it. The
    window is closed after the last one.

    Returns:
        The frames as they are drawn, each once in a row.
    """
    shown: list[Frame] = []
    pressed: dict[Player, Iterator[str]] = {}
    advance, paint = Player.advance, Painter.paint

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
    def test_without_a_display_it_plays_in_the_terminal(self) -> None:
        done = run("basic_env.py", display="none_such")
        assert done.returncode == 0
        assert re.fullmatch(
            r"no window can be opened \(.*none_such.*\): showing text\n", done.stderr
        )
        assert "step 0/80" in done.stdout
        assert "The target was found" in figures(done.stdout)["outcome"]

    def test_summary(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert demo.main(["--text", *SHORT]) == 0
        summary = figures(capsys.readouterr().out)
        assert summary["outcome"] == "The target was not found (the time limit was reached)"
        assert summary["return"] == "-400,000.0 (sum over the drones)"
        assert summary["steps"] == "8 of at most 8"
        assert summary["persons found"] == "0 of 1"

    def test_missing_persons_can_be_hidden(self, capsys: pytest.CaptureFixture[str]) -> None:
        shown = []
        for hide in ([], ["--hide-person"]):
            demo.main(["--text", "--grid-size", "12", *hide])
            output = capsys.readouterr().out
            shown.append((" P@" in output, bool(re.search(r"F\d[.:;=oO%#@]", output))))
        assert shown == [(True, True), (False, True)]

    def test_prints_some_frames_of_a_long_search(self, capsys: pytest.CaptureFixture[str]) -> None:
        demo.main(["--text", "--probability-of-detection", "0", "--timestep-limit", "1000"])
        steps = re.findall(r"step (\d+)/1000", capsys.readouterr().out)
        assert steps == ["0", "200", "400", "600", "800", "1000"]

    def test_draws_in_place_on_a_terminal(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
        monkeypatch.setattr("shutil.get_terminal_size", lambda: os.terminal_size((60, 12)))
        demo.main(["--text", "--fps", "50", *SHORT])
        output = capsys.readouterr().out
        assert re.findall(r"step (\d+)/8", output) == [str(step) for step in range(9)]
        assert output.count("\x1b[11A") == 8, "every frame but the first starts 11 lines higher"

    @pytest.mark.parametrize("terminal", [(80, 24), (40, 10), (20, 6), (10, 3), (300, 80)])
    def test_fits_any_terminal(self, terminal: tuple[int, int]) -> None:
        matrix = np.zeros((20, 20), np.float32)
        matrix[15, 18] = 1.0
        frame = Frame(
            matrix=matrix,
            drones=((0, 0), (18, 15)),
            searching=(False, False),
            persons=((5, 5),),
            found_by=(None,),
            step=3,
            timestep_limit=10,
            vector=(0.5, -0.25),
            ending=Ending.TIME_LIMIT,
            hypotheses=((1 / 18,) * 18,),
            probability_of_success=0.5,
        )
        columns, rows = terminal
        lines = fitted(frame, columns, rows)
        assert len(lines) <= rows
        assert max(map(len, lines)) <= columns
        if columns >= 40:
            assert any("1@" in line for line in lines), "the likeliest cell is shown"
        if columns == 300:
            legend = lines.pop()
            assert [*lines, legend] == render_text(frame, columns).split("\n")

    def test_an_interrupt_ends_without_a_traceback(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def interrupt(*_: object) -> None:
            raise KeyboardInterrupt

        monkeypatch.setattr(DroneSwarmSearch, "step", interrupt)
        assert demo.main(["--text"]) == 130
        assert capsys.readouterr().err == "\ninterrupted\n"

    @pytest.mark.skipif(sys.platform == "win32", reason="the system does not name this error")
    def test_a_closed_output_pipe_ends_the_demo_quietly(self) -> None:
        with subprocess.Popen(
            [sys.executable, "-m", "DroneSwarmSearch", "--text"],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        ) as process:
            assert process.stdout is not None
            assert process.stderr is not None
            process.stdout.close()
            assert process.stderr.read() == b""
            assert process.wait(timeout=60) == 1


class TestOptions:
    def test_help_names_every_option(self, capsys: pytest.CaptureFixture[str]) -> None:
        with pytest.raises(SystemExit) as stop:
            demo.main(["--help"])
        assert stop.value.code == 0
        text = capsys.readouterr().out
        for option in (
            *(
                "--manual",
                "--hide-person",
                "--drones",
                "--grid-size",
                "--persons",
                "--vector",
                "--record",
            ),
            *("--disperse-constant", "--timestep-limit", "--probability-of-detection"),
            *("--seed", "--fps", "--grid", "--no-grid", "--gradient", "--no-gradient"),
            *("--prior", "--text", "--policy", "--palette", "--mission", "--object-class"),
            *("--wind", "--current", "--position-sd", "--adrift", "--diffusivity"),
            *("--cell", "--drone-speed"),
        ):
            assert re.search(rf"^ +.*{option}\b(?!-).*\n? +\S", text, re.MULTILINE), option

    def test_a_misspelled_policy_is_corrected(self, capsys: pytest.CaptureFixture[str]) -> None:
        line = refusal(capsys, "--text", "--policy", "planer")
        assert line.endswith("got 'planer'; did you mean planner?")

    @pytest.mark.parametrize(
        ("option", "values", "problem"),
        [
            ("--grid-size", ["1"], "must be an integer of at least 2, got 1"),
            ("--grid-size", ["7.5"], "invalid int value: '7.5'"),
            ("--drones", ["0"], "must be an integer from 1 to 576, got 0"),
            ("--drones", ["577"], "must be an integer from 1 to 576, got 577"),
            ("--persons", ["0"], "must be an integer of at least 1, got 0"),
            ("--persons", ["many"], "invalid int value: 'many'"),
            ("--vector", ["nan", "0"], "must be a finite number, got nan"),
            ("--vector", ["1"], "expected 2 arguments"),
            ("--disperse-constant", ["-1"], "must be a finite number of at least 0, got -1.0"),
            ("--timestep-limit", ["0"], "must be an integer from 1 to 9007199254740992, got 0"),
            (
                "--probability-of-detection",
                ["1.5"],
                "must be a finite number of at least 0 and at most 1, got 1.5",
            ),
            ("--seed", ["-1"], "must be an integer of at least 0, got -1"),
            ("--fps", ["0"], "must be a finite number of at least 0.1 and at most 50.0, got 0.0"),
            ("--fps", ["fast"], "invalid float value: 'fast'"),
            ("--palette", ["ocean"], "invalid choice: 'ocean'"),
            ("--policy", ["none.npz"], "there is no file 'none.npz'"),
            ("--policy", ["best"], "must be one of random, parallel-sweep"),
            ("--record", ["video.avi"], "must end in .gif or .mp4, got 'video.avi'"),
        ],
    )
    def test_bad_values(
        self, capsys: pytest.CaptureFixture[str], option: str, values: list[str], problem: str
    ) -> None:
        line = refusal(capsys, "--text", option, *values)
        assert f"error: argument {option}: {problem}" in line

    @pytest.mark.parametrize(
        ("option", "values", "problem"),
        [
            ("--object-class", ["PIW"], "must be a key of leeway.CLASSES, got 'PIW'; the nearest"),
            ("--wind", ["240"], "expected 2 arguments"),
            ("--wind", ["240", "-1"], "must be degrees and knots: speed must be a finite number"),
            ("--current", ["nan", "1"], "must be degrees and knots: direction must be a finite"),
            ("--position-sd", ["-1"], "must be a finite number of at least 0"),
            ("--adrift", ["-1"], "must be a finite number of at least 0"),
            ("--diffusivity", ["9e9"], "must be at most 433 m"),
            ("--cell", ["0"], "must be a finite number above 0, got 0.0"),
            ("--drone-speed", ["-3"], "must be a finite number above 0, got -3.0"),
            ("--grid-size", ["1"], "must be an integer of at least 2, got 1"),
            ("--persons", ["0"], "must be an integer of at least 1, got 0"),
            ("--vector", ["1", "0"], "not allowed with --object-class"),
            ("--disperse-constant", ["1"], "not allowed with --object-class"),
        ],
    )
    def test_bad_values_of_an_incident(
        self, capsys: pytest.CaptureFixture[str], option: str, values: list[str], problem: str
    ) -> None:
        line = refusal(capsys, "--text", *INCIDENT, option, *values)
        assert f"error: argument {option}: {problem}" in line

    @pytest.mark.parametrize(
        "option",
        [
            *(["--wind", "240", "20"], ["--current", "60", "1"], ["--position-sd", "5"]),
            *(["--adrift", "60"], ["--diffusivity", "1"], ["--cell", "50"]),
            ["--drone-speed", "5"],
        ],
    )
    def test_an_incident_needs_an_object(
        self, capsys: pytest.CaptureFixture[str], option: list[str]
    ) -> None:
        line = refusal(capsys, "--text", *option)
        assert line.endswith(f"error: argument {option[0]}: needs --object-class")

    @pytest.mark.parametrize("other", [["--text"], ["--record", "video.gif"]])
    def test_manual_needs_the_window(
        self, capsys: pytest.CaptureFixture[str], other: list[str]
    ) -> None:
        assert "argument --manual: needs the window" in refusal(capsys, "--manual", *other)

    def test_manual_needs_the_usual_policy(self, capsys: pytest.CaptureFixture[str]) -> None:
        line = refusal(capsys, "--manual", "--policy", "greedy-posterior")
        assert "the other drones use greedy-matrix, so --policy is not allowed" in line

    @pytest.mark.parametrize("policy", POLICIES)
    def test_every_policy_runs_and_is_deterministic(
        self, capsys: pytest.CaptureFixture[str], policy: str
    ) -> None:
        small = ("--text", "--grid-size", "8", "--timestep-limit", "15", "--fps", "50")
        shown = []
        for _ in range(2):
            assert demo.main([*small, "--policy", policy]) == 0
            shown.append(capsys.readouterr().out)
        assert shown[0] == shown[1]

    @pytest.mark.parametrize(("drones", "size"), [(1, 2), (4, 2), (4, 20), (7, 5), (76, 20)])
    def test_drones_start_around_the_border(
        self, drones: int, size: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        shown: list[Frame] = []
        monkeypatch.setattr(demo.terminal, "show", lambda frames, fps: shown.append(next(frames)))
        demo.main(["--text", "--drones", str(drones), "--grid-size", str(size)])
        cells = shown[0].drones
        assert len(set(cells)) == len(cells) == drones
        assert all({x, y} & {0, size - 1} for x, y in cells)

    def test_more_drones_than_border_cells(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert demo.main(["--text", "--grid-size", "4", "--drones", "16"]) == 0
        assert figures(capsys.readouterr().out)["persons found"] == "1 of 1"


class TestIncident:
    def frames(self, monkeypatch: pytest.MonkeyPatch, *arguments: str) -> list[Frame]:
        """The frames of an incident."""
        shown: list[Frame] = []
        monkeypatch.setattr(demo.terminal, "show", lambda frames, fps: shown.extend(frames))
        assert demo.main(["--text", *INCIDENT, *arguments]) == 0
        return shown

    def test_it_prints_the_hypotheses_the_result_and_the_scale(
        self, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert demo.main(["--text", *INCIDENT, "--adrift", "600", "--seed", "1"]) == 0
        captured = capsys.readouterr()
        assert captured.err == ""
        assert captured.out.splitlines()[1] == "hypotheses: 50% 50%"
        summary = figures(captured.out)
        assert summary["persons found"] == "0 of 1"
        assert re.fullmatch(r"\d+\.\d% \(probability of success\)", summary["POS"])
        assert summary["scale"] == (
            "20 x 20 cells of 130 m are 2.6 km x 2.6 km; 12 steps of 13 s are 2.6 min"
        )

    def test_it_is_the_drift_of_the_leeway_model(self, monkeypatch: pytest.MonkeyPatch) -> None:
        arguments = ["--current", "60", "0.5", "--position-sd", "300", "--adrift", "3600"]
        arguments += ["--diffusivity", "8", "--cell", "100", "--drone-speed", "5", "--prior"]
        last = self.frames(monkeypatch, *arguments)[-1]
        person = leeway.person(
            "PIW-1",
            start=(0, 0),
            position_sd=300,
            wind=leeway.wind_from(240, 20 * leeway.KNOT),
            current=leeway.current_towards(60, 0.5 * leeway.KNOT),
            diffusivity=8,
            adrift=3600,
            scale=Scale(100, 20),
        )
        vector = np.mean([drift.vector for drift in person.drifts], axis=0)
        assert last.vector == pytest.approx(vector)
        columns = last.matrix.sum(axis=0, dtype=float)
        at = np.arange(last.grid_size)
        mean = columns @ at
        spreads = [np.hypot(drift.start_sd[0], 192 * drift.vector_sd[0]) for drift in person.drifts]
        apart = 192 * abs(person.drifts[0].vector[0] - person.drifts[1].vector[0]) / 2
        variance = np.mean(np.square(spreads)) + apart**2 + 192 * person.drifts[0].diffusion
        assert columns @ (at - mean) ** 2 == pytest.approx(variance, rel=0.1)

    @pytest.mark.parametrize(
        ("wind", "current", "signs"),
        [
            (("270", "20"), ("0", "0"), (1, 0)),
            (("0", "20"), ("0", "0"), (0, 1)),
            (("0", "0"), ("90", "1"), (1, 0)),
            (("0", "0"), ("0", "1"), (0, -1)),
        ],
    )
    def test_wind_comes_from_and_current_flows_to_a_direction(
        self,
        wind: tuple[str, str],
        current: tuple[str, str],
        signs: tuple[int, int],
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        shown = self.frames(monkeypatch, "--wind", *wind, "--current", *current)
        assert tuple(np.sign(np.round(shown[0].vector, 3))) == signs

    @pytest.mark.parametrize("adrift", ["0", "1800", "7200"])
    def test_the_grid_is_around_the_forecast(
        self, adrift: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        shown = self.frames(monkeypatch, "--adrift", adrift, "--prior", "--seed", "1")
        assert capsys.readouterr().err == ""
        assert (shown[0].grid_size > 20) == (adrift == "7200")
        matrix = shown[6].matrix.astype(float)
        at = np.arange(len(matrix))
        centre = len(matrix) // 2
        assert abs(matrix.sum(axis=0) @ at - centre) < 1
        assert abs(matrix.sum(axis=1) @ at - centre) < 1

    def test_the_coverage_mission(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        arguments = ["--mission", "coverage", "--position-sd", "200", "--timestep-limit", "40"]
        assert demo.main(["--text", *INCIDENT, *arguments]) == 0
        summary = figures(capsys.readouterr().out)
        last = (shown := self.frames(monkeypatch, *arguments))[-1]
        assert last.persons == ()
        success = f"{last.probability_of_success:.1%}"
        assert summary["POS"] == f"{success} (probability of success)"
        assert summary["outcome"].startswith(f"Probability of success {success} (the time limit")
        assert "persons found" not in summary
        searched = [cell for frame in shown for cell in compress(frame.drones, frame.searching)]
        cells, searches = len(set(searched)), len(searched)
        line = f"{cells} of 400; {searches - cells} of {searches} searches repeated"
        assert summary["cells searched"] == line


@pytest.mark.usefixtures("dummy_video")
class TestWindow:
    def test_it_plays_to_the_end_and_stays_open(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        opened = []

        def script(player: Player) -> Iterator[str]:
            yield from watch(player)
            for _ in range(200):
                opened.append(pygame.display.get_surface() is not None)
                yield ""
            yield "return"
            raise AssertionError("Enter closes the window at the end")

        shown = perform(monkeypatch, script)
        assert demo.main(["--fps", "50", *FOUND]) == 0
        captured = capsys.readouterr()
        assert captured.err == ""
        assert all(opened)
        assert shown[-1].ending is Ending.FOUND
        assert "The target was found" in figures(captured.out)["outcome"]
        assert not pygame.display.get_init()

    @pytest.mark.parametrize(
        ("key", "reason"),
        [("", "the window was closed"), ("escape", "you quit"), ("q", "you quit")],
    )
    @pytest.mark.parametrize("manual", [[], ["--manual"]])
    def test_quitting(
        self,
        capsys: pytest.CaptureFixture[str],
        monkeypatch: pytest.MonkeyPatch,
        key: str,
        reason: str,
        manual: list[str],
    ) -> None:
        perform(monkeypatch, lambda player: iter([key] if key else []))
        assert demo.main(manual) == 0
        assert figures(capsys.readouterr().out)["outcome"] == f"stopped: {reason}"
        assert not pygame.display.get_init()

    def test_the_default_search_is_worth_watching(self, monkeypatch: pytest.MonkeyPatch) -> None:
        shown = perform(monkeypatch, watch)
        assert demo.main(["--fps", "50"]) == 0
        first, last = shown[0], shown[-1]
        ((x, y),) = first.persons
        assert min(abs(x - a) + abs(y - b) for a, b in first.drones) > 10
        assert last.ending is Ending.FOUND
        assert 20 <= last.step <= 40
        assert np.hypot(*last.vector) * last.step > 5, "the map drifts"
        assert last.matrix.max() < 0.05, "and spreads"

    def test_frames_hold_the_prior_the_policy_and_the_return(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        shown = perform(monkeypatch, watch)
        assert demo.main(["--fps", "50", "--policy", "greedy-posterior"]) == 0
        last = shown[-1]
        assert last.policy == "greedy-posterior"
        assert last.prior is not None
        searched = [cell for frame in shown for cell in compress(frame.drones, frame.searching)]
        where = tuple(np.transpose(searched)[::-1])
        assert last.matrix[where].sum() < last.prior[where].sum()
        assert figures(capsys.readouterr().out)["return"].startswith(f"{last.total_return:,.1f}")

    def test_the_prior_beside_the_posterior(self, monkeypatch: pytest.MonkeyPatch) -> None:
        sizes = []

        def script(player: Player) -> Iterator[str]:
            for key in ("", "p", "p"):
                yield key
                yield ""
                surface = pygame.display.get_surface()
                sizes.append(surface and surface.get_size())

        perform(monkeypatch, script)
        assert demo.main(SHORT) == 0
        assert sizes[0] == sizes[2]

    def test_the_next_seed_is_that_of_the_option(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def script(player: Player) -> Iterator[str]:
            yield from watch(player)
            yield "n"
            yield from watch(player)

        shown = perform(monkeypatch, script)
        assert demo.main(["--fps", "50", "--seed", "4"]) == 0
        reports = capsys.readouterr().out.split("\n\n")
        assert [figures(each)["search"][-6:] for each in reports] == ["seed 4", "seed 5"]
        demo.main(["--text", "--seed", "5"])
        assert figures(reports[1])["steps"] == figures(capsys.readouterr().out)["steps"]
        assert shown[-1].step == int(figures(reports[1])["steps"].split()[0])

    def test_an_interrupt(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def script(player: Player) -> Iterator[str]:
            yield ""
            raise KeyboardInterrupt

        perform(monkeypatch, script)
        assert demo.main([]) == 130
        assert capsys.readouterr().err == "\ninterrupted\n"
        assert not pygame.display.get_init()


@pytest.mark.usefixtures("dummy_video")
class TestManual:
    def test_keys_fly_drone_0(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        shown = perform(monkeypatch, keys("right", "s", "space", "i", ".", "left", "w", "left"))
        assert demo.main(["--manual"]) == 0
        path = [frame.drones[0] for frame in shown]
        assert path == [(0, 0), (1, 0), *[(1, 1)] * 4, (0, 1), (0, 0)]
        assert [frame.searching[0] for frame in shown].index(True) == 3
        assert shown[-1].ending is None, "the last key leads out of the grid, so it is refused"
        assert shown[-1].drones[1] != shown[0].drones[1], "the policy flies the others"
        summary = figures(capsys.readouterr().out)
        assert summary["policy"] == "you fly drone 0, greedy-matrix the others"
        assert summary["outcome"] == "stopped: the window was closed"

    def test_the_other_drones_avoid_drone_0(self, monkeypatch: pytest.MonkeyPatch) -> None:
        shown = perform(monkeypatch, keys(*["right", "i", "left", "down", "i", "up"] * 20))
        arguments = ["--manual", "--drones", "6", "--grid-size", "4", "--timestep-limit", "40"]
        demo.main([*arguments, "--probability-of-detection", "0"])
        assert {frame.ending for frame in shown} == {None, Ending.TIME_LIMIT}

    def test_a_game_against_the_policies(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        shown = perform(monkeypatch, keys(*["space"] * 40))
        arguments = ["--drones", "2", "--grid-size", "12", "--timestep-limit", "40"]
        assert demo.main(["--manual", "--hide-person", *arguments]) == 0
        assert {frame.hide_persons for frame in shown if frame.ending is None} == {True}
        assert shown[-1].hide_persons is False
        output = capsys.readouterr().out
        rows = re.findall(r"^([\w() -]+?)  +((?:not )?found in \d+ steps?)", output, re.MULTILINE)
        results = dict(rows)
        assert set(results) == {"you (drone 0)", *demo.RIVALS}
        for policy in demo.RIVALS:
            assert demo.main(["--text", "--policy", policy, *arguments]) == 0
            steps = figures(capsys.readouterr().out)["steps"].split()[0]
            assert re.search(r"\d+", results[policy])[0] == steps

    def test_without_a_display(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("SDL_VIDEODRIVER", "none_such")
        assert "--manual needs a display" in refusal(capsys, "--manual")

    def test_with_a_hidden_window(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert "--manual needs a display" in refusal(capsys, "--manual")
        assert not pygame.display.get_init()


class TestNamedSearch:
    def test_a_search_of_the_suite(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert demo.main(["pond", "--text", "--policy", "greedy-posterior", "--seed", "3"]) == 0
        summary = figures(capsys.readouterr().out)
        assert summary["search"] == "pond, seed 3"
        assert summary["policy"] == "greedy-posterior"
        (pond,) = evaluate("greedy-posterior", "pond", episodes=1, seed=3).episodes.steps
        assert summary["steps"] == f"{pond} of at most 40"

    def test_a_search_at_sea(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert command_line.main(["play", "gale", "--text", "--timestep-limit", "9"]) == 0
        output = capsys.readouterr().out
        assert output.startswith("gale: A life raft ")
        summary = figures(output)
        assert summary["steps"] == "9 of at most 9"
        assert summary["scale"].startswith("44 x 44 cells of 300 m")

    def test_a_file(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        path = tmp_path / "mine.json"
        path.write_text('{"grid_size": 6, "timestep_limit": 3}')
        assert demo.main([str(path), "--text"]) == 0
        assert figures(capsys.readouterr().out)["search"] == "mine, seed 0"

    def test_an_unknown_name(self, capsys: pytest.CaptureFixture[str]) -> None:
        line = refusal(capsys, "gael", "--text")
        assert "error: argument SEARCH: must be one of pond, " in line
        assert "did you mean gale" in line

    @pytest.mark.parametrize("option", ["--drones", "--grid-size", "--persons"])
    def test_options_of_another_search(
        self, option: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        line = refusal(capsys, "pond", option, "2")
        assert line.endswith(f"error: argument {option}: not allowed with a SEARCH")


class TestVideo:
    def test_gif(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        image = pytest.importorskip("PIL.Image")
        video = tmp_path / "search.gif"
        assert demo.main(["--record", str(video), "--fps", "10", *SHORT]) == 0
        assert "search.gif" in capsys.readouterr().err
        with image.open(video) as gif:
            assert gif.width == 600
            durations = []
            for picture in range(gif.n_frames):
                gif.seek(picture)
                durations.append(gif.info["duration"])
            # Eight steps of 100 ms; the last picture, like all, is shown for a part of a step.
            assert sum(durations) == pytest.approx(8 * 100 + 2000, abs=60)
        assert video.stat().st_size < 250_000

    def test_mp4(self, tmp_path: Path) -> None:
        ffmpeg = pytest.importorskip("imageio_ffmpeg")
        video = tmp_path / "search.mp4"
        assert demo.main(["--record", str(video), "--fps", "10", *INCIDENT]) == 0
        _, seconds = ffmpeg.count_frames_and_secs(str(video))
        assert seconds == pytest.approx(12 / 10 + 2, abs=0.1)

    def test_a_path_that_cannot_be_written(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        (tmp_path / "file").touch()
        target = tmp_path / "file" / "video.gif"
        with pytest.raises(SystemExit) as stop:
            demo.main(["--record", str(target), *SHORT])
        assert stop.value.code == 1
        assert capsys.readouterr().err.splitlines()[-1].startswith(f"cannot write {target}: ")
