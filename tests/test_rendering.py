"""Frames as text, as pictures and in the window."""

import math
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from helpers import make_frame, plain
from numpy.typing import NDArray

from DroneSwarmSearch import DroneSwarmSearch, Ending, Scale
from DroneSwarmSearch.core import Frame
from DroneSwarmSearch.rendering import PALETTES, Look, render_text
from DroneSwarmSearch.rendering.display import Display
from DroneSwarmSearch.rendering.labels import percent, signed, tick_stride
from DroneSwarmSearch.rendering.palette import FOUND, NOT_FOUND, PROGRESS

pygame = pytest.importorskip("pygame")

from DroneSwarmSearch.rendering.painter import GAP, HEAD, Painter  # noqa: E402 (needs pygame)
from DroneSwarmSearch.rendering.search_map import LEFT, TOP, SearchMap  # noqa: E402

SIZES = (2, 20, 48)


class Picture:
    """The picture of a frame as signed integers, for arithmetic, and its parts."""

    def __init__(self, frame: Frame, **look: Any) -> None:
        size = frame.grid_size
        drawing = SearchMap(size, Look())
        self.whole = Painter(size, Look(**look)).pixels(frame).astype(np.int64)
        self.head = self.whole[:HEAD, LEFT : LEFT + drawing.side]
        self.below = self.whole[HEAD + TOP - 5 :, LEFT - 5 :]
        self.map = self.below[5 : 5 + drawing.side, 5 : 5 + drawing.side]
        self.panel = self.whole[:, drawing.size[0] + GAP :]
        self._cell = drawing.side // size

    def cell(self, x: int, y: int) -> NDArray[np.int64]:
        """The pixels of a cell, shape (side, side, 3)."""
        side = self._cell
        return self.map[y * side : (y + 1) * side, x * side : (x + 1) * side]


def differs(one: NDArray[np.int64], other: NDArray[np.int64], least: int = 0) -> NDArray[np.bool_]:
    """Which pixels of two pictures differ in a channel by more than the least."""
    return np.asarray(np.abs(one - other).max(axis=2) > least)


def bare(frame: Frame) -> Frame:
    """A frame without its drones and persons."""
    return replace(frame, drones=(), searching=(), persons=(), found_by=())


class TestLabels:
    @pytest.mark.parametrize(
        ("ending", "persons", "outcome"),
        [
            (None, 0, ""),
            (Ending.COVERED, 0, "The area was covered in 3 steps"),
            (Ending.TIME_LIMIT, 0, "Probability of success 83.4%"),
            (Ending.COLLISION, 0, "Probability of success 83.4%"),
            (Ending.FOUND, 1, "The person was found in 3 steps"),
            (Ending.TIME_LIMIT, 1, "The person was not found"),
        ],
    )
    def test_outcomes(self, ending, persons, outcome):
        frame = make_frame(2, persons=((1, 1),) * persons, ending=ending)
        frame = replace(frame, probability_of_success=0.834)
        assert frame.outcome == outcome
        at_sea = replace(frame, scale=Scale(100, 240))
        assert at_sea.outcome == outcome.replace("3 steps", "12 min")

    def test_numbers(self):
        assert [percent(value) for value in (0.123456, 0.0)] == ["12.3%", "0%"]
        for value, text in (
            (-0.5, "-0.50"),
            (0.0, "+0.00"),
            (0.05, "+0.05"),
            (0.096, "+0.10"),
            (0.0596, "+0.060"),
            (-0.0098, "-0.0098"),
            (1.2e-5, "+1.2e-05"),
            (12345, "+1.23e+04"),
        ):
            assert signed(value) == text
        for room, pitch, stride in ((26, 26, 1), (26, 14, 2), (26, 7, 5), (3, 0.01, 500)):
            assert tick_stride(room, pitch) == stride


class TestText:
    def test_a_running_search(self):
        frame = make_frame(
            3,
            drones=((0, 0), (2, 1)),
            searching=(1,),
            persons=((2, 1), (0, 2)),
            found=(1,),
            matrix=[[0.0, 0.05, 0.05], [0.1, 0.2, 0.4], [0.1, 0.05, 0.05]],
        )
        assert render_text(frame).split("\n") == [
            "step 3/10 | drift x +0.50, y -0.25 cells/step | found 1/2",
            "      0    1    2",
            "0    0.    :    :",
            "1     ;    o 1*P@",
            "2   F0;    :    :",
            "0-1 drone, * searching, + more, listed below | P person, F0 found by drone 0",
            ".:;=oO%#@ probability, 0 to 40%",
        ]

    def test_what_is_known_of_uncertain_persons(self):
        frame = replace(make_frame(2), probability_of_success=0.1234)
        assert render_text(frame).split("\n")[0].endswith(" | found 0/1 | POS 12.3%")
        for hypotheses, shown in (
            (((0.62, 0.38),), ["hypotheses: 62% 38%"]),
            (
                ((1.0,), (0.5, 0.5), (0.2, 0.8)),
                ["hypotheses of person 1: 50% 50%", "hypotheses of person 2: 20% 80%"],
            ),
        ):
            n = len(hypotheses)
            persons = {"persons": ((1, 1),) * n, "found_by": (None,) * n}
            uncertain = replace(frame, hypotheses=hypotheses, **persons)
            assert render_text(uncertain).split("\n")[1 : 1 + len(shown)] == shown
        certain = replace(frame, hypotheses=((1.0,),))
        assert render_text(certain) == render_text(frame)

    @pytest.mark.parametrize(
        ("grid_size", "rows", "width", "side"),
        [(12, None, 5, 1), (24, None, 3, 1), (30, None, 2, 1), (76, None, 1, 1), (100, None, 1, 2)]
        + [(16, 23, 4, 1), (24, 23, 5, 2)],
    )
    def test_maps_fit_80_columns_and_the_terminal(self, grid_size, rows, width, side):
        last = grid_size - 1
        frame = make_frame(grid_size, drones=((0, 0), (last, last)), persons=((last, 0),))
        lines = render_text(frame, rows=rows).split("\n")
        assert max(map(len, lines)) <= 80
        assert len(lines) <= (rows or 200)
        margin = len(str(last)) + 1
        places = math.ceil(grid_size / side)
        cells = lines[2 : 2 + places]
        assert [int(line[: margin - 1]) for line in cells] == [*range(0, grid_size, side)]
        assert {len(line) for line in cells} == {margin + width * places}
        # In a single character, a drone or a person takes the place of the probability.
        marks = [cells[0][margin:][:width], cells[0][-width:], cells[-1][-width:]]
        assert [mark.strip()[0] for mark in marks] == ["0", "P", "1"]
        assert all(len(mark.strip()) == min(width, 2) for mark in marks)
        assert (f"of {side} x {side} cells" in lines[-1]) == (side > 1)

    def test_what_does_not_fit_a_cell_is_listed(self):
        drones = ((0, 0), (1, 0), (2, 0), (2, 0), (3, 0))
        persons = (1, 0), (3, 0)
        frame = make_frame(40, drones=drones, searching=(0, 1), persons=persons)
        frame = replace(frame, found_by=(1, None))
        lines = render_text(frame).split("\n")
        assert lines[2].startswith(" 0 0+++")
        assert lines[-3] == "(0, 0): 0* | (1, 0): 1*F1 | (2, 0): 2+3 | (3, 0): 4P"

    def test_a_find_is_set_beside_the_probability_of_success(self):
        frame = replace(make_frame(2, ending=Ending.FOUND), probability_of_success=0.25)
        sentence = "Found here; 25.0% of all persons would be found by now"
        assert render_text(frame).split("\n")[2] == sentence
        lost = replace(frame, ending=Ending.TIME_LIMIT)
        assert "Found here" not in render_text(lost)

    @pytest.mark.parametrize(
        ("seconds", "line"),
        [
            (240, "minute 12/40 | drift E +0.21, N +0.10 m/s"),
            (30, "minute 1.5/5.0 | drift E +1.67, N +0.83 m/s"),
        ],
    )
    def test_a_search_at_sea(self, seconds, line):
        frame = make_frame(2)
        rows = render_text(replace(frame, scale=Scale(100, seconds))).split("\n")
        plain_rows = render_text(frame).split("\n")
        assert rows == [f"{line} | found 0/1", *plain_rows[1:]]
        assert len(rows[0]) <= len(plain_rows[0])


class TestFlown:
    def test_the_drone_flown_by_hand_is_marked_on_the_map_and_in_the_legend(self):
        frame = make_frame(8, drones=((1, 1), (6, 6)), persons=())
        painter = Painter(8)
        before, after = (
            painter.pixels(each).astype(np.int64) for each in (frame, replace(frame, flown=1))
        )
        y, x = np.nonzero(differs(before, after))
        on_map = x < LEFT + 720
        assert (y[on_map] > HEAD + TOP + 360).all() and on_map.any()
        assert (~on_map).any()


class TestCells:
    @pytest.mark.parametrize("grid_size", SIZES)
    @pytest.mark.parametrize("gradient", [True, False])
    def test_the_least_likely_cells_are_red_or_pale_and_the_most_likely_green_or_blue(
        self, grid_size, gradient
    ):
        picture = Picture(bare(make_frame(grid_size)), gradient=gradient, palette="classic")
        r, g, b = picture.cell(0, 0).reshape(-1, 3).T
        assert (r > 2 * g).all() and (r > 2 * b).all()
        r, g, b = picture.cell(1, 1).reshape(-1, 3).T
        assert (g > 1.5 * r).all() and (g > 1.5 * b).all()
        sea = Picture(bare(make_frame(grid_size)), gradient=gradient)
        assert (sea.cell(0, 0) > 230).all()
        r, g, b = sea.cell(1, 1).reshape(-1, 3).T
        assert (b > 2 * g).all() and (g > 2 * r).all()

    @pytest.mark.parametrize("palette", PALETTES)
    def test_the_luminance_of_every_shade_differs_strictly(self, palette):
        part = Look(palette=palette).ramp / 255
        light = np.where(part <= 0.04045, part / 12.92, ((part + 0.055) / 1.055) ** 2.4)
        steps = np.diff(light @ np.array([0.2126, 0.7152, 0.0722]))  # as WCAG 2 defines it
        assert (steps > 0).all() if palette == "classic" else (steps < 0).all()

    def test_environments_take_a_palette(self):
        pictures = []
        for palette in PALETTES:
            env = DroneSwarmSearch(render_mode="rgb_array", palette=palette)
            env.reset(seed=0)
            pictures.append(env.render())
            assert (pictures[-1] == Picture(env.frame(), palette=palette).whole).all()
        assert (pictures[0] != pictures[1]).any()

    def test_without_gradient_there_are_three_colours_with_the_limits_of_the_readme(self):
        matrix = np.zeros((2, 2))
        colours = []
        for share in (0.0, 0.2499, 0.25, 0.7499, 0.75, 1.0):
            matrix[0] = (1.0, share)
            frame = bare(make_frame(2, matrix=matrix))
            picture = Picture(frame, gradient=False, palette="classic")
            colours.append(tuple(picture.cell(1, 0)[100, 100]))
        red, yellow, green = colours[::2]
        assert colours == [red, red, yellow, yellow, green, green]
        assert len({red, yellow, green}) == 3
        assert yellow[0] > 200 and yellow[1] > 160 and yellow[2] < 120

    @pytest.mark.parametrize("grid_size", SIZES)
    def test_grid_lines_are_between_cells_only(self, grid_size):
        frame = bare(make_frame(grid_size))
        one = Picture(frame, grid=True)
        other = Picture(frame)
        changed = differs(one.map, other.map)
        side = len(changed) // grid_size
        expected = np.zeros_like(changed)
        expected[side::side] = True
        expected[:, side::side] = True
        assert (changed == expected).all()
        assert differs(one.whole, other.whole).sum() == changed.sum()


class TestSymbols:
    @pytest.mark.thorough
    @pytest.mark.parametrize("grid_size", SIZES)
    def test_drones_and_persons_are_visible_and_distinct(self, grid_size):
        at = ((0, 1),)
        frame = bare(make_frame(grid_size))
        symbols = [{}, *({"drones": at, "searching": (each,)} for each in (False, True))]
        symbols += [{"persons": at, "found_by": (each,)} for each in (None, 0, 1)]
        looks = [Picture(replace(frame, **symbol)) for symbol in symbols]
        for number, look in enumerate(looks):
            for other in looks[:number]:
                assert differs(look.map, other.map, 60).sum() > 0.02 * look.cell(0, 1)[..., 0].size

    @pytest.mark.thorough
    @pytest.mark.parametrize("grid_size", [20, 48, 200])
    def test_25_drones_differ(self, grid_size):
        stride = max(grid_size // 20, 1)
        looks = []
        for drone in range(25):
            drones = [(9 * stride, 9 * stride)] * 25
            drones[drone] = (3 * stride, 3 * stride)
            looks.append(Picture(make_frame(grid_size, drones=tuple(drones), persons=())).map)
        for number, look in enumerate(looks):
            for other in looks[:number]:
                area = np.s_[: 6 * len(look) // 20, : 6 * len(look) // 20]
                assert differs(look[area], other[area], 60).sum() > 12

    def test_trails_and_marks_of_searches_fade(self):
        frame = make_frame(20, drones=((9, 3),))
        trail = tuple((x, 3) for x in range(10))
        searched = ((4, 9, 25), (5, 9, 12), (6, 9, 1), (8, 9, 99))
        before = Picture(frame)
        after = Picture(replace(frame, trails=(trail,), searched=searched))

        def change(x: int, y: int) -> int:
            return int(np.abs(after.cell(x, y) - before.cell(x, y)).sum())

        assert change(8, 3) > change(4, 3) > change(0, 3) > 0 == change(9, 5)
        assert change(6, 9) > change(5, 9) > change(4, 9) > 0 == change(8, 9)

    def test_drones_are_on_their_way_and_the_rest_waits(self):
        before = make_frame(20, drones=((3, 3), (9, 9)))
        after = make_frame(20, drones=((4, 3), (9, 9)), ending=Ending.FOUND)
        after = replace(after, step=4, matrix=np.full((20, 20), 1 / 400, np.float32))
        painter = Painter(20)
        still, moving = (painter.pixels(before, towards=after, progress=at) for at in (0.0, 0.5))
        assert (still == painter.pixels(before)).all()
        rows, columns = (moving != still).any(axis=2).nonzero()
        side = SearchMap(20, Look()).side // 20
        assert abs(rows - HEAD - TOP - 3.5 * side).max() <= side / 2 + 3
        assert abs(columns - LEFT - 4 * side).max() <= side + 3

    def test_the_environment_knows_its_trails_searches_and_return(self):
        env = DroneSwarmSearch(9, n_drones=2, bayesian_update=True, mission="coverage")
        env.reset(seed=1)
        total = 0.0
        for actions in ((3, 1), (4, 1), (1, 4)):
            _, rewards, *_ = env.step(dict(zip(env.agents, actions, strict=True)))
            total += rewards["total_reward"]
        frame = env.frame()
        assert frame.trails == (((0, 0), (0, 1), (0, 1), (1, 1)), ((1, 0), (2, 0), (3, 0), (3, 0)))
        assert frame.searched == ((0, 1, 1), (3, 0, 0))
        assert frame.total_return == total
        assert frame.prior is not None and (frame.prior != frame.matrix).any()
        env.reset(seed=2)
        frame = env.frame()
        assert (frame.trails, frame.searched) == ((((0, 0),), ((1, 0),)), ())
        assert frame.total_return == 0.0


class TestPicture:
    def test_the_panel_shows_the_state(self):
        frame = make_frame()
        success = {"probability_of_success": 0.2}
        panels = {Picture(frame).panel.tobytes()}
        for change in (
            {"step": 4},
            {"vector": (0.5, -0.5)},
            {"found_by": (0,)},
            success,
            {"matrix": np.full((7, 7), 1 / 49, dtype=np.float32)},
            {"hypotheses": ((0.7, 0.3),)},
            {"persons": (), "found_by": (), **success},
        ):
            panels.add(Picture(replace(frame, **change)).panel.tobytes())
        assert len(panels) == 8

    @pytest.mark.parametrize("grid_size", [7, 50])
    def test_many_persons_with_many_hypotheses_fit(self, grid_size):
        hypotheses = tuple((1 / count,) * count for count in (18, 1, 400, 2, 18, 3))
        frame = make_frame(grid_size, drones=((1, 1),) * 40, persons=((1, 1),) * 6)
        frame = replace(frame, probability_of_success=0.5)
        picture = Picture(replace(frame, hypotheses=hypotheses))
        assert differs(picture.panel, Picture(frame).panel).any()
        assert (picture.panel[-20:] == picture.whole[-1, -1]).all()
        assert (picture.whole[:, -20:] == picture.whole[-1, -1]).all()

    @pytest.mark.parametrize("ending", list(Ending))
    @pytest.mark.parametrize(("grid_size", "palette", "n"), [(48, "sea", 1), (7, "classic", 0)])
    def test_the_end_has_the_colour_of_the_outcome(self, grid_size, palette, n, ending):
        frame = make_frame(grid_size, persons=((1, 1),) * n)
        before = Picture(frame, palette=palette)
        picture = Picture(replace(frame, ending=ending), palette=palette)
        colour = FOUND if ending in (Ending.FOUND, Ending.COVERED) else NOT_FOUND
        if ending is Ending.TIME_LIMIT and not n:
            colour = PROGRESS
        assert (picture.head == colour).all(axis=2).mean() > 0.4
        side = len(picture.map)
        assert (picture.below[2, 5 : 5 + side] == colour).all()
        assert (picture.below[5 : 5 + side, side + 7] == colour).all()
        assert not differs(before.map, picture.map).any()
        assert not differs(before.panel, picture.panel)[HEAD + TOP :].any()

    def test_the_prior_is_left_of_the_posterior(self):
        painter = Painter(20, view="both")
        matrix, prior = np.zeros((2, 20, 20), np.float32)
        matrix[1, 1] = prior[4, 4] = 1.0
        frame = replace(make_frame(20, matrix=matrix), prior=prior)
        one, other = (
            painter.pixels(frame) != painter.pixels(replace(frame, **{name: 1 - matrix}))
            for name in ("prior", "matrix")
        )
        left, right = (np.flatnonzero(each.any(axis=(0, 2))) for each in (one, other))
        assert left.max() < 0.45 * painter.size[0] and right.min() > 0.4 * painter.size[0]

    @pytest.mark.parametrize("grid_size", [2, 3, 7, 47, 48, 49, 100, 481, 1001, 5000])
    def test_sizes_are_even_and_reasonable(self, grid_size):
        width, height = Painter(grid_size).size
        assert width % 2 == 0 and height % 2 == 0
        assert 480 <= SearchMap(grid_size, Look()).side <= 1000
        assert width <= 1400 and height <= 1100

    def test_text_needs_no_pygame_and_pictures_start_only_its_font(self):
        code = (
            "import sys; import numpy as np\n"
            "from DroneSwarmSearch import DroneSwarmSearch\n"
            "env = DroneSwarmSearch(2, person_initial_position=(1, 1)); env.reset(); env.render()\n"
            "assert 'pygame' not in sys.modules\n"
            "env = DroneSwarmSearch(2, render_mode='rgb_array', person_initial_position=(1, 1))\n"
            "env.reset(); env.render()\n"
            "import pygame\n"
            "assert not pygame.display.get_init() and not pygame.joystick.get_init()\n"
            "assert pygame.mixer.get_init() is None\n"
        )
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
        assert done.stdout == done.stderr == b""


class TestAtSea:
    """Pictures of a search with a scale."""

    @staticmethod
    def labels(picture: Picture) -> tuple[list[float], list[float]]:
        """The middles of the numbers at the top and at the left, in cells from the corner."""
        side = len(picture.map)
        top = picture.whole[HEAD + TOP - 22 : HEAD + TOP - 6, LEFT - 16 : LEFT + side]
        left = picture.whole[HEAD + TOP - 6 : HEAD + TOP + side, LEFT - 40 : LEFT - 4]
        found = []
        for strip, axis, start in ((top, 0, -16), (left, 1, -6)):
            inked = np.flatnonzero((strip < 200).all(axis=2).any(axis=axis)) + start
            groups = np.split(inked, np.flatnonzero(np.diff(inked) > 8) + 1)
            found.append([(group[0] + group[-1]) / 2 * 20 / side for group in groups])
        return found[0], found[1]

    def test_coordinates_are_kilometres_from_the_corner(self):
        frame = make_frame(20)
        for across in self.labels(Picture(frame)):  # the middles of the cells, without a scale
            assert across == pytest.approx([cell + 0.5 for cell in range(20)], abs=0.15)
        for metres, apart in ((500, 2), (100, 2), (300, 5 / 3), (1000, 2)):
            for along in self.labels(Picture(replace(frame, scale=Scale(metres, 10)))):
                expected = np.arange(0, 20, apart)
                assert along == pytest.approx(expected[: len(along)], abs=0.15), metres
                assert len(along) == len(expected)

    @pytest.mark.parametrize("view", ["matrix", "both"])
    def test_the_reason_is_below_the_map(self, view):
        frame = make_frame(7)
        bare = Painter(7, view=view).pixels(frame)
        height = 0
        for reason in ("A raft.", "A raft drifts in a gale, and three drones search for it. " * 4):
            picture = Painter(7, view=view, reason=reason).pixels(frame)
            assert (picture[: len(bare)] == bare).all()
            text = differs(picture[len(bare) :].astype(int), picture[-1, -1].astype(int), 60)
            assert text.any() and not text[:, :LEFT].any() and not text[:, -20:].any()
            assert len(picture) > max(height, len(bare))
            height = len(picture)


@pytest.mark.parametrize("person", [(19, 19), (7, 4), (2, 3)])
def test_nothing_depends_on_a_hidden_person(person):
    frame = make_frame(20, drones=((2, 2),))
    hidden = replace(frame, hide_persons=True)
    one, other = (Picture(replace(hidden, persons=(at,))) for at in ((5, 5), person))
    assert not differs(one.whole, other.whole).any()
    assert differs(one.map, Picture(replace(frame, persons=(person,))).map).any()


def show(display: Display, **changes: Any) -> None:
    """Show a frame in the window of an environment."""
    display.render(make_frame(**changes), "human")


@pytest.mark.usefixtures("dummy_display")
class TestWindow:
    def test_it_shows_the_picture(self, monkeypatch):
        monkeypatch.setattr(pygame.display, "get_desktop_sizes", lambda: [(1920, 1080)])
        display = Display(7, fps=1000)
        assert not pygame.display.get_init()
        show(display, searching=(0,))
        screen = pygame.display.get_surface()
        shown = pygame.surfarray.array3d(screen).transpose(1, 0, 2)
        assert np.array_equal(shown, Painter(7).pixels(make_frame(searching=(0,))))
        display.close()
        assert not pygame.display.get_init()
        show(display)
        assert pygame.display.get_init()

    def test_it_fits_a_small_desktop(self, monkeypatch):
        monkeypatch.setattr(pygame.display, "get_desktop_sizes", lambda: [(800, 600)])
        show(Display(7, fps=1000))
        width, height = pygame.display.get_surface().get_size()
        assert 600 < width < 800 and 400 < height < 600

    def test_a_reset_reopens_a_window_that_the_user_closed(self):
        env = DroneSwarmSearch(grid_size=5, render_mode="human")
        env.reset(seed=1)
        pygame.event.post(pygame.event.Event(pygame.QUIT))
        with pytest.warns(UserWarning, match="window was closed") as caught:
            env.step({"drone0": 5})
        assert len(caught) == 1
        env.step({"drone0": 5})
        assert not pygame.display.get_init()
        env.reset()
        assert pygame.display.get_init()

    def test_key_events_stay_in_the_queue_and_others_are_removed(self):
        display = Display(7, fps=1000)
        show(display)
        pygame.event.clear()
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_LEFT, unicode="", mod=0))
        pygame.event.post(pygame.event.Event(pygame.USEREVENT))
        pygame.event.post(pygame.event.Event(pygame.KEYUP, key=pygame.K_LEFT, mod=0))
        for _ in range(3):
            show(display)
        left = pygame.event.get()
        assert [event.type for event in left] == [pygame.KEYDOWN, pygame.KEYUP]
        assert left[0].key == pygame.K_LEFT

    def test_waits_for_a_frame_period_after_each_frame(self, monkeypatch):
        ticks: list[float] = []
        clock = SimpleNamespace(tick=lambda fps: ticks.append(fps) or 50)
        monkeypatch.setattr(pygame.time, "Clock", lambda: clock)
        display = Display(7, fps=20.0)
        for _ in range(3):
            show(display)
        assert ticks == [20.0] * 3

    def test_without_a_display_a_reset_warns_and_the_episode_is_the_same(self, monkeypatch):
        env, twin = (DroneSwarmSearch(grid_size=5, render_mode=mode) for mode in ("human", None))
        monkeypatch.setenv("SDL_VIDEODRIVER", "there_is_no_such_driver")
        with pytest.warns(UserWarning, match=r"no window.*rgb_array.*ansi.*SDL_VIDEODRIVER=dummy"):
            shown = env.reset(seed=1)
        assert plain(shown) == plain(twin.reset(seed=1))
        assert env.render() is None
        assert plain(env.step({"drone0": 1})) == plain(twin.step({"drone0": 1}))

    def test_an_episode_continues_without_its_window(self, monkeypatch):
        env = DroneSwarmSearch(grid_size=5, render_mode="human", vector=(0.2, 0.1))
        twin = DroneSwarmSearch(grid_size=5, vector=(0.2, 0.1))
        env.reset(seed=1)
        twin.reset(seed=1)
        pygame.quit()
        monkeypatch.setenv("SDL_VIDEODRIVER", "there_is_no_such_driver")
        with pytest.warns(UserWarning, match="continues without a window"):
            shown = env.step({"drone0": 1})
        assert plain(shown) == plain(twin.step({"drone0": 1}))
        assert plain(env.step({"drone0": 3})) == plain(twin.step({"drone0": 3}))  # no warning

    def test_a_hidden_display_is_used_only_on_request(self, monkeypatch):
        monkeypatch.setattr(pygame.display, "get_driver", lambda: "offscreen")
        show(Display(7, fps=1000))
        pygame.quit()
        monkeypatch.delenv("SDL_VIDEODRIVER")
        monkeypatch.setattr(pygame.display, "init", lambda: None)
        with pytest.raises(RuntimeError, match="no screen"):
            show(Display(7, fps=1000))
