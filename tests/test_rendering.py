"""Frames as text, as pictures and in the window."""

from __future__ import annotations

import copy
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from helpers import plain, whole_state
from numpy.typing import NDArray

from DroneSwarmSearch import DroneSwarmSearch, ResetNeeded
from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.rendering.display import Display
from DroneSwarmSearch.rendering.labels import outcome_in_brief, percent, signed, tick_stride
from DroneSwarmSearch.rendering.painter import GAP, HEAD, Painter
from DroneSwarmSearch.rendering.palette import (
    FOUND,
    NOT_FOUND,
    PALETTES,
    PROGRESS,
    Look,
)
from DroneSwarmSearch.rendering.search_map import LEFT, TOP, SearchMap
from DroneSwarmSearch.rendering.text import render_text
from DroneSwarmSearch.rules import Ending

pygame = pytest.importorskip("pygame")
PIL = pytest.importorskip("PIL.Image")

MAP_TOP = HEAD + TOP

SIZES = (2, 7, 20, 48)


def make_frame(
    grid_size: int = 7,
    *,
    drones: tuple[tuple[int, int], ...] = ((0, 0),),
    searching: tuple[int, ...] = (),
    persons: tuple[tuple[int, int], ...] = ((1, 1),),
    found: tuple[int, ...] = (),
    matrix: object = None,
    ending: Ending | None = None,
) -> Frame:
    """A frame; `searching` and `found` are indices, and drone 0 finds all persons.

    Without a matrix, cell (1, 1) has all the probability.
    """
    if matrix is None:
        matrix = np.zeros((grid_size, grid_size))
        matrix[1, 1] = 1.0
    return Frame(
        matrix=np.asarray(matrix, dtype=np.float32),
        drones=drones,
        searching=tuple(i in searching for i in range(len(drones))),
        persons=persons,
        found_by=tuple(0 if i in found else None for i in range(len(persons))),
        step=3,
        timestep_limit=10,
        vector=(0.5, -0.25),
        ending=ending,
    )


def draw(
    frame: Frame, *, grid: bool = False, gradient: bool = True, palette: str = "classic"
) -> NDArray[np.int64]:
    """The picture of a frame as signed integers, for arithmetic."""
    painter = Painter(frame.grid_size, Look(grid, gradient, palette))
    return painter.pixels(frame).astype(np.int64)


def cell_of(picture: NDArray[np.int64], grid_size: int, x: int, y: int) -> NDArray[np.int64]:
    """Return the pixels of a cell, shape (side, side, 3)."""
    side = SearchMap(grid_size, Look()).side // grid_size
    top, left = MAP_TOP + y * side, LEFT + x * side
    return picture[top : top + side, left : left + side]


def panel_left(grid_size: int) -> int:
    """The left edge of the panel."""
    return SearchMap(grid_size, Look()).size[0] + GAP


def map_of(picture: NDArray[np.int64], grid_size: int) -> NDArray[np.int64]:
    """Return the pixels of the map, shape (side, side, 3)."""
    side = SearchMap(grid_size, Look()).side
    return picture[MAP_TOP : MAP_TOP + side, LEFT : LEFT + side]


def head_of(picture: NDArray[np.int64], grid_size: int) -> NDArray[np.int64]:
    """The pixels of the headline above the map."""
    side = SearchMap(grid_size, Look()).side
    return picture[:HEAD, LEFT : LEFT + side]


def luminance(colours: NDArray[np.int64] | NDArray[np.uint8]) -> NDArray[np.float64]:
    """Relative luminance of sRGB colours, as WCAG 2 defines it."""
    part = np.asarray(colours) / 255
    light = np.where(part <= 0.04045, part / 12.92, ((part + 0.055) / 1.055) ** 2.4)
    return np.asarray(light @ np.array([0.2126, 0.7152, 0.0722]))


def bare(frame: Frame) -> Frame:
    """A frame without its drones and persons."""
    return replace(frame, drones=(), searching=(), persons=(), found_by=())


class TestLabels:
    @pytest.mark.parametrize(
        ("room", "pitch", "stride"),
        [
            *((26, 26, 1), (26, 14, 2), (26, 7, 5), (26, 2, 20), (3, 0.01, 500)),
        ],
    )
    def test_tick_stride_is_the_least_that_leaves_the_room(
        self, room: float, pitch: float, stride: int
    ) -> None:
        assert tick_stride(room, pitch) == stride

    @pytest.mark.parametrize(
        ("ending", "outcome", "brief"),
        [
            (None, "", ""),
            (Ending.COVERED, "The area was covered in 3 moves", "covered in 3 steps"),
            (Ending.TIME_LIMIT, "Probability of success 83.4%", "not covered in 3 steps"),
            (Ending.COLLISION, "Probability of success 83.4%", "drones collided in step 3"),
        ],
    )
    def test_outcomes_of_the_coverage_mission(
        self, ending: Ending | None, outcome: str, brief: str
    ) -> None:
        frame = make_frame(2, persons=(), ending=ending)
        frame = replace(frame, probability_of_success=0.834)
        assert frame.outcome == outcome
        assert outcome_in_brief(frame) == brief

    def test_numbers(self) -> None:
        assert percent(0.123456) == "12.3%"
        assert percent(0.0) == "0%"
        assert signed(-0.5) == "-0.50"
        assert [signed(value) for value in (0.0, 0.05, 0.1, 0.096)] == [
            *("+0.00", "+0.05", "+0.10", "+0.10")
        ]
        assert [signed(value) for value in (0.0596, -0.0098, 1.2e-5)] == [
            *("+0.060", "-0.0098", "+1.2e-05")
        ]
        assert signed(12345.0) == "+1.23e+04"


class TestText:
    def test_a_running_search(self) -> None:
        frame = make_frame(
            3,
            drones=((0, 0), (2, 1)),
            searching=(1,),
            persons=((2, 1), (0, 2)),
            found=(1,),
            matrix=[[0.0, 0.05, 0.05], [0.1, 0.2, 0.4], [0.1, 0.05, 0.05]],
        )
        assert render_text(frame).split("\n") == [
            "step 3/10 | drift x +0.50, y -0.25 cells/step | persons found 1/2",
            "      0    1    2",
            "0    0.    :    :",
            "1     ;    o 1*P@",
            "2   F0;    :    :",
            "0-1 drone, * searching, + same cell | person: P missing, F0 found by drone 0 | "
            + ".:;=oO%#@ probability, 0 to 40%",
        ]

    def test_a_collision_in_cells_of_persons(self) -> None:
        frame = make_frame(
            2,
            drones=((1, 1), (1, 1)),
            persons=((1, 1), (1, 1), (1, 1)),
            found=(2,),
            matrix=[[0.25, 0.25], [0.25, 0.25]],
            ending=Ending.COLLISION,
        )
        assert render_text(frame).split("\n")[1:-1] == [
            f"The target was not found ({Ending.COLLISION.description})",
            "          0        1",
            "0         @        @",
            "1         @ 0+1P2F0@",
        ]

    def test_what_is_known_of_uncertain_persons(self) -> None:
        frame = replace(make_frame(2), probability_of_success=0.1234)
        assert render_text(frame).split("\n")[0].endswith(" | persons found 0/1 | POS 12.3%")
        eighteen = (0.235, *(0.045,) * 17)
        for hypotheses, line in (
            (((0.62, 0.38),), "hypotheses: 62% 38%"),
            ((eighteen,), "hypotheses: 18, the likeliest 24%"),
            (
                ((1.0,), (0.5, 0.5), eighteen),
                "hypotheses: person 1 50% 50% | person 2 18, the likeliest 24%",
            ),
            (
                ((0.5, 0.5),) * 9,
                "hypotheses: "
                + " | ".join(f"person {person} 50% 50%" for person in range(4))
                + " | 5 more persons",
            ),
        ):
            persons = ((1, 1),) * len(hypotheses)
            found_by = (None,) * len(hypotheses)
            uncertain = replace(frame, hypotheses=hypotheses, persons=persons, found_by=found_by)
            assert render_text(uncertain).split("\n")[1] == line
        certain = replace(frame, hypotheses=((1.0,),))
        assert render_text(certain) == render_text(frame)

    def test_hundreds_of_drones_and_numbered_columns(self) -> None:
        drones = tuple((i % 100, 2 * (i // 100)) for i in range(300))
        frame = make_frame(100, drones=drones, searching=(299,), persons=((99, 99),))
        lines = render_text(frame).split("\n")
        columns, rows = lines[1], lines[2:102]
        assert len({len(row) for row in rows}) == 1
        width = (len(rows[0]) - 3) // 100
        assert rows[4][3 + 99 * width :] == "299*."
        assert rows[0][3 : 3 + 2 * width] == "   0.   1."
        assert rows[99].endswith("P.")
        assert [int(number) for number in columns.split()] == list(range(100))
        assert columns.index("42") + 2 == 3 + 43 * width

    def test_text_needs_no_pygame(self) -> None:
        code = (
            "import sys; import DroneSwarmSearch.rendering;"
            "import DroneSwarmSearch.rendering.text;"
            "sys.exit(any(name.split('.')[0] == 'pygame' for name in sys.modules))"
        )
        assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


class TestCells:
    @pytest.mark.parametrize("grid_size", SIZES)
    @pytest.mark.parametrize("gradient", [True, False])
    def test_the_least_likely_cells_are_red_and_the_most_likely_green(
        self, grid_size: int, gradient: bool
    ) -> None:
        picture = draw(bare(make_frame(grid_size)), gradient=gradient)
        r, g, b = cell_of(picture, grid_size, 0, 0).reshape(-1, 3).T
        assert (r > 2 * g).all() and (r > 2 * b).all()
        r, g, b = cell_of(picture, grid_size, 1, 1).reshape(-1, 3).T
        assert (g > 1.5 * r).all() and (g > 1.5 * b).all()

    @pytest.mark.parametrize("palette", PALETTES)
    def test_the_luminance_of_every_shade_differs_strictly(self, palette: str) -> None:
        steps = np.diff(luminance(PALETTES[palette].ramp))
        assert (steps > 0).all() if palette == "classic" else (steps < 0).all()

    def test_environments_take_a_palette(self) -> None:
        pictures = []
        for palette in PALETTES:
            env = DroneSwarmSearch(render_mode="rgb_array", palette=palette)
            env.reset(seed=0)
            pictures.append(env.render())
            expected = draw(env.frame(), palette=palette)
            assert (pictures[-1] == expected).all()
        assert (pictures[0] != pictures[1]).any()

    def test_without_gradient_there_are_three_colours_with_the_limits_of_the_readme(self) -> None:
        matrix = np.zeros((2, 2))
        colours = {}
        for share in (0.0, 0.2499, 0.25, 0.7499, 0.75, 1.0):
            matrix[0] = (1.0, share)
            picture = draw(bare(make_frame(2, matrix=matrix)), gradient=False)
            colours[share] = tuple(cell_of(picture, 2, 1, 0)[100, 100])
        red, yellow, green = colours[0.0], colours[0.25], colours[1.0]
        assert len({red, yellow, green}) == 3
        assert colours[0.2499] == red
        assert colours[0.7499] == yellow
        assert colours[0.75] == green
        assert yellow[0] > 200 and yellow[1] > 160 and yellow[2] < 120

    def test_x_is_to_the_right_and_y_is_down(self) -> None:
        matrix = np.zeros((7, 7))
        matrix[2, 5] = 1.0
        picture = draw(bare(make_frame(matrix=matrix)))
        greener = [
            (x, y)
            for y in range(7)
            for x in range(7)
            if (cell := cell_of(picture, 7, x, y)[50, 50])[1] > cell[0]
        ]
        assert greener == [(5, 2)]

    @pytest.mark.parametrize("grid_size", SIZES)
    def test_grid_lines_are_between_cells_only(self, grid_size: int) -> None:
        frame = bare(make_frame(grid_size))
        changed = (draw(frame, grid=True) != draw(frame)).any(axis=2)
        side = SearchMap(grid_size, Look()).side // grid_size
        board = changed[MAP_TOP : MAP_TOP + side * grid_size, LEFT : LEFT + side * grid_size]
        expected = np.zeros_like(board)
        expected[side::side] = True
        expected[:, side::side] = True
        assert (board == expected).all()
        assert changed.sum() == board.sum()

    def test_more_cells_than_pixels_can_be_drawn(self) -> None:
        matrix = np.zeros((1300, 1300))
        matrix[:200] = 1.0
        picture = draw(make_frame(1300, matrix=matrix, drones=((1299, 1299),)), grid=True)
        top, bottom = map_of(picture, 1300)[20, 500], map_of(picture, 1300)[600, 505]
        assert top[1] > top[0]
        assert bottom[0] > bottom[1]


class TestSymbols:
    @pytest.mark.parametrize("grid_size", SIZES)
    def test_drones_and_persons_are_visible_and_distinct(self, grid_size: int) -> None:
        at = ((0, 1),)
        frame = bare(make_frame(grid_size))
        empty = cell_of(draw(frame), grid_size, 0, 1)
        looks = [
            cell_of(draw(other), grid_size, 0, 1)
            for other in (
                replace(frame, drones=at, searching=(False,)),
                replace(frame, drones=at, searching=(True,)),
                replace(frame, persons=at, found_by=(None,)),
                replace(frame, persons=at, found_by=(0,)),
            )
        ]
        for number, look in enumerate(looks):
            for other in [empty, *looks[:number]]:
                differs = np.abs(look - other).max(axis=2) > 60
                assert differs.mean() > 0.05

    @pytest.mark.parametrize("grid_size", [20, 48])
    def test_25_adjacent_drones_differ(self, grid_size: int) -> None:
        drones = tuple((i % grid_size, i // grid_size) for i in range(25))
        picture = draw(make_frame(grid_size, drones=drones, persons=()))
        side = SearchMap(grid_size, Look()).side // grid_size
        middles = np.array(
            [
                cell_of(picture, grid_size, x, y)[side // 2 - 1 : side // 2 + 2].mean(axis=(0, 1))
                for x, y in drones
            ]
        )
        if grid_size == 20:  # large enough for numbers
            assert len(np.unique(middles, axis=0)) == 25
            return
        distances = np.linalg.norm(middles[:, None] - middles, axis=2)
        assert distances[~np.eye(25, dtype=bool)].min() > 12

    @pytest.mark.parametrize("grid_size", SIZES)
    def test_a_found_person_has_the_colour_of_the_finder(self, grid_size: int) -> None:
        frame = replace(bare(make_frame(grid_size)), persons=((1, 1),))
        first, second = (
            map_of(draw(replace(frame, found_by=(drone,))), grid_size) for drone in (0, 1)
        )
        assert (np.abs(first - second).max(axis=2) > 60).sum() >= 12

    @pytest.mark.parametrize("grid_size", SIZES)
    def test_a_drone_over_a_person_hides_neither(self, grid_size: int) -> None:
        frame = make_frame(grid_size, drones=((1, 1), (0, 0)), persons=((1, 1),))
        pictures = [
            map_of(draw(other), grid_size)[SearchMap(grid_size, Look()).side // grid_size :]
            for other in (
                frame,
                replace(frame, drones=((0, 0), (1, 1))),  # a drone of another colour
                replace(frame, found_by=(0,)),
            )
        ]
        for other in pictures[1:]:
            assert (np.abs(pictures[0] - other).max(axis=2) > 40).sum() >= 20


class TestPanel:
    @pytest.mark.parametrize(
        "change",
        [
            {"step": 4},
            {"vector": (0.5, -0.5)},
            {"found_by": (0,)},
            {"drones": ((0, 0), (0, 0)), "searching": (False, False)},
            {"matrix": np.full((7, 7), 1 / 49, dtype=np.float32)},
            {"probability_of_success": 0.2},
            {"hypotheses": ((0.7, 0.3),)},
            {"persons": (), "found_by": (), "probability_of_success": 0.2},
        ],
    )
    def test_it_shows_the_state(self, change: dict[str, object]) -> None:
        frame = make_frame()
        left = panel_left(7)
        before = draw(frame)[:, left:]
        after = draw(replace(frame, **change))[:, left:]  # type: ignore[arg-type]
        assert (before != after).any()

    @pytest.mark.parametrize("grid_size", [7, 50])
    def test_many_persons_with_many_hypotheses_fit(self, grid_size: int) -> None:
        hypotheses = tuple((1 / count,) * count for count in (18, 1, 400, 2, 18, 3))
        frame = replace(
            make_frame(grid_size, drones=((1, 1),) * 40, persons=((1, 1),) * 6),
            probability_of_success=0.5,
        )
        picture = draw(replace(frame, hypotheses=hypotheses))
        assert picture.shape == draw(frame).shape
        assert (
            picture[:, panel_left(grid_size) :] != draw(frame)[:, panel_left(grid_size) :]
        ).any()
        paper = picture[-1, -1]
        assert (picture[-20:, panel_left(grid_size) :] == paper).all()
        assert (picture[:, -20:] == paper).all()


class TestEndScreens:
    @pytest.mark.parametrize("ending", list(Ending))
    @pytest.mark.parametrize(("grid_size", "palette"), [(7, "classic"), (48, "sea")])
    def test_the_banner_and_the_frame_are_green_for_found_and_red_for_not_found(
        self, grid_size: int, ending: Ending, palette: str
    ) -> None:
        picture = draw(make_frame(grid_size, ending=ending), palette=palette)
        colour = FOUND if ending in (Ending.FOUND, Ending.COVERED) else NOT_FOUND
        side = SearchMap(grid_size, Look()).side
        assert (head_of(picture, grid_size) == colour).all(axis=2).mean() > 0.4
        assert (picture[MAP_TOP - 3, LEFT : LEFT + side] == colour).all()
        assert (picture[MAP_TOP : MAP_TOP + side, LEFT + side + 2] == colour).all()

    def test_the_time_limit_of_the_coverage_mission_is_no_failure(self) -> None:
        frame = make_frame(persons=(), ending=Ending.TIME_LIMIT)
        head = head_of(draw(replace(frame, probability_of_success=0.8)), 7)
        assert (head == PROGRESS).all(axis=2).mean() > 0.4
        assert not (head == NOT_FOUND).all(axis=2).any()

    @pytest.mark.parametrize("grid_size", SIZES)
    def test_the_end_hides_nothing_and_changes_no_colours(self, grid_size: int) -> None:
        frame = make_frame(grid_size)
        before, after = draw(frame), draw(replace(frame, ending=Ending.FOUND))
        assert not map_of(before != after, grid_size).any()
        assert (
            before[MAP_TOP:, panel_left(grid_size) :] == after[MAP_TOP:, panel_left(grid_size) :]
        ).all()


class TestBothMaps:
    def test_the_prior_is_left_of_the_posterior(self) -> None:
        grid_size = 20
        painter = Painter(grid_size, view="both")
        matrix, prior = np.zeros((2, grid_size, grid_size), np.float32)
        matrix[1, 1] = prior[4, 4] = 1.0
        frame = replace(make_frame(grid_size, matrix=matrix), prior=prior)
        width = painter.size[0]
        one, other = (
            painter.pixels(frame) != painter.pixels(replace(frame, **{name: 1 - matrix}))
            for name in ("prior", "matrix")
        )
        left, right = (np.flatnonzero(each.any(axis=(0, 2))) for each in (one, other))
        assert left.max() < 0.45 * width and right.min() > 0.4 * width


class TestTrailsAndSearches:
    def test_trails_are_drawn_and_fade(self) -> None:
        start = make_frame(20, drones=((9, 3),))
        trail = tuple((x, 3) for x in range(10))
        changed = np.abs(draw(replace(start, trails=(trail,))) - draw(start)).sum(axis=2)
        by_cell = [cell_of(changed[..., None], 20, x, 3).mean() for x in range(9)]
        assert by_cell[8] > by_cell[4] > by_cell[0] > 0
        assert not cell_of(changed[..., None], 20, 9, 5).any()

    def test_marks_of_searches_fade(self) -> None:
        frame = make_frame(20)
        searched = ((4, 9, 25), (5, 9, 12), (6, 9, 1), (8, 9, 99))
        changed = np.abs(draw(replace(frame, searched=searched)) - draw(frame)).sum(axis=2)
        old, middle, new, gone = (
            cell_of(changed[..., None], 20, x, 9).sum() for x, _, _ in searched
        )
        assert new > middle > old > 0 == gone

    def test_missing_persons_can_be_hidden(self) -> None:
        frame = make_frame(persons=((1, 1), (4, 4)), found=(1,))
        without = replace(frame, persons=((4, 4),), found_by=(0,))
        hidden, expected = (
            map_of(draw(replace(frame, hide_persons=True)), 7),
            map_of(draw(without), 7),
        )
        assert (hidden == expected).all()
        assert (map_of(draw(frame), 7) != hidden).any()

    def test_the_environment_knows_its_trails_searches_and_return(self) -> None:
        env = DroneSwarmSearch(
            grid_size=9,
            n_drones=2,
            person_initial_position=(1, 1),
            bayesian_update=True,
            mission="coverage",
        )
        env.reset(seed=1)
        total = 0.0
        for actions in ((3, 1), (4, 1), (1, 4)):
            _, rewards, *_ = env.step(dict(zip(env.agents, actions, strict=True)))
            total += rewards["total_reward"]
        frame = env.frame()
        assert frame.trails == (((0, 0), (0, 1), (0, 1), (1, 1)), ((1, 0), (2, 0), (3, 0), (3, 0)))
        assert frame.searched == ((0, 1, 1), (3, 0, 0))
        assert frame.total_return == total
        assert frame.prior is not None and abs(frame.prior.sum() - 1.0) < 1e-6
        assert (frame.prior != frame.matrix).any()
        env.reset(seed=2)
        frame = env.frame()
        assert (frame.trails, frame.searched) == ((((0, 0),), ((1, 0),)), ())
        assert frame.total_return == 0.0


class TestMotion:
    def test_drones_are_on_their_way_and_the_rest_waits(self) -> None:
        before = make_frame(20, drones=((3, 3), (9, 9)))
        matrix = np.full((20, 20), 1 / 400)
        after = replace(
            make_frame(20, drones=((4, 3), (9, 9)), matrix=matrix, ending=Ending.FOUND), step=4
        )
        painter = Painter(20)
        pictures = [painter.pixels(before, towards=after, progress=at) for at in (0.0, 0.5)]
        assert (pictures[0] == painter.pixels(before)).all()
        changed = (pictures[1] != pictures[0]).any(axis=2)
        rows, columns = changed.nonzero()
        side = SearchMap(20, Look()).side // 20
        assert MAP_TOP + 3 * side - 3 <= rows.min() <= rows.max() <= MAP_TOP + 4 * side + 3
        assert LEFT + 3 * side - 3 <= columns.min() <= columns.max() <= LEFT + 5 * side + 3


class TestLargeGrids:
    """Of a large grid, the map shows where the search takes place."""

    def frame(self, at: int = 70, spread: int = 3) -> Frame:
        matrix = np.zeros((100, 100))
        matrix[at - spread : at + spread, at - spread : at + spread] = 1.0
        return make_frame(100, drones=((at - 8, at),), persons=((at + 2, at),), matrix=matrix)

    def test_the_overview_leaves_drones_in_all_corners_visible(self) -> None:
        corners = ((54, 54), (85, 54), (54, 85), (85, 85))
        frame = replace(self.frame(), drones=corners, persons=(), found_by=())
        for number in range(4):
            shown = replace(frame, searching=tuple(drone == number for drone in range(4)))
            quiet = replace(frame, searching=(False,) * 4)
            assert (draw(shown) != draw(quiet)).any()

    @pytest.mark.parametrize("person", [(99, 99), (53, 86), (70, 70)])
    def test_nothing_depends_on_a_hidden_person(self, person: tuple[int, int]) -> None:
        frame = replace(self.frame(), hide_persons=True)
        hidden, elsewhere = (draw(replace(frame, persons=(at,))) for at in ((50, 50), person))
        assert (hidden == elsewhere).all()

    def test_a_wide_search_is_shown_whole(self) -> None:
        matrix = np.full((100, 100), 1e-4)
        picture = draw(make_frame(100, drones=((0, 0),), matrix=matrix))
        other = draw(make_frame(100, drones=((99, 99),), matrix=matrix))
        rows, columns = map_of((picture != other).any(axis=2), 100).nonzero()
        assert rows.min() < 20 and rows.max() > 700
        assert columns.min() < 20 and columns.max() > 700


class TestPainter:
    @pytest.mark.parametrize("grid_size", [2, 3, 7, 47, 48, 49, 100, 481, 1001, 5000])
    def test_sizes_are_even_and_reasonable(self, grid_size: int) -> None:
        width, height = Painter(grid_size).size
        assert width % 2 == 0 and height % 2 == 0
        assert 480 <= SearchMap(grid_size, Look()).side <= 1000
        assert width <= 1400 and height <= 1100

    def test_off_screen_only_the_font_is_started(self) -> None:
        code = (
            "import numpy as np\n"
            "from DroneSwarmSearch.frame import Frame\n"
            "from DroneSwarmSearch.rendering.painter import Painter\n"
            "import pygame\n"
            "p = Painter(2)\n"
            "assert not pygame.font.get_init()\n"
            "m = np.full((2, 2), 0.25, dtype=np.float32)\n"
            "p.pixels(Frame(m, ((0, 0),), (True,), ((1, 1),), (None,), 0, 9, (0.0, 0.0), None))\n"
            "assert not pygame.display.get_init()\n"
            "assert pygame.mixer.get_init() is None\n"
            "assert not pygame.joystick.get_init()\n"
        )
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.fixture
def dummy_display(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Quit pygame and select the dummy video driver."""
    pygame.quit()
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    yield
    pygame.quit()


def show(display: Display, **changes: Any) -> None:
    """Show a frame in the window of an environment."""
    display.render(make_frame(**changes), "human")


@pytest.mark.usefixtures("dummy_display")
class TestWindow:
    def test_it_shows_the_picture(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(pygame.display, "get_desktop_sizes", lambda: [(1920, 1080)])
        display = Display(7, fps=1000)
        assert not pygame.display.get_init()
        show(display, searching=(0,))
        screen = pygame.display.get_surface()
        shown = pygame.surfarray.array3d(screen).transpose(1, 0, 2)
        assert np.array_equal(shown, Painter(7).pixels(make_frame(searching=(0,))))
        assert not pygame.joystick.get_init()
        assert pygame.mixer.get_init() is None
        display.close()
        display.close()
        assert not pygame.display.get_init()
        show(display)
        assert pygame.display.get_init()

    def test_it_fits_a_small_desktop(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(pygame.display, "get_desktop_sizes", lambda: [(800, 600)])
        show(Display(7, fps=1000))
        width, height = pygame.display.get_surface().get_size()
        assert 600 < width < 800 and 400 < height < 600

    def test_a_reset_reopens_a_window_that_the_user_closed(self) -> None:
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

    def test_key_events_stay_in_the_queue_and_others_are_removed(self) -> None:
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

    def test_waits_for_a_frame_period_after_each_frame(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        ticks: list[float] = []

        class Clock:
            def tick(self, fps: float) -> int:
                ticks.append(fps)
                return 50

        monkeypatch.setattr(pygame.time, "Clock", Clock)
        display = Display(7, fps=20.0)
        for _ in range(3):
            show(display)
        assert ticks == [20.0] * 3

    def test_copies_are_not_open(self) -> None:
        display = Display(7, fps=1000)
        show(display)
        twin = copy.deepcopy(display)
        twin.close()
        assert pygame.display.get_init()
        show(twin)

    def test_without_a_display_the_error_states_what_to_do(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("SDL_VIDEODRIVER", "there_is_no_such_driver")
        with pytest.raises(RuntimeError, match=r"rgb_array.*ansi.*SDL_VIDEODRIVER=dummy"):
            show(Display(7, fps=1000))
        assert not pygame.display.get_init()

    def test_without_a_display_a_reset_changes_nothing(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        env = DroneSwarmSearch(grid_size=5, render_mode="human")
        env.reset(seed=1)
        env.step({"drone0": 5})
        env.close()
        before, twin = whole_state(env), copy.deepcopy(env)
        monkeypatch.setenv("SDL_VIDEODRIVER", "there_is_no_such_driver")
        for _ in range(2):
            with pytest.raises(RuntimeError, match="no window can be opened"):
                env.reset(seed=2, vector=(0.3, 0.3))
            assert whole_state(env) == before
        new = DroneSwarmSearch(render_mode="human")
        with pytest.raises(RuntimeError, match="no window can be opened"):
            new.reset()
        with pytest.raises(ResetNeeded):
            new.step({"drone0": 5})
        monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
        assert plain(env.step({"drone0": 1})) == plain(twin.step({"drone0": 1}))

    def test_an_episode_continues_without_its_window(self, monkeypatch: pytest.MonkeyPatch) -> None:
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
        monkeypatch.undo()
        monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
        env.reset()
        assert pygame.display.get_init()
        env.close()

    def test_a_hidden_display_is_used_only_on_request(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(pygame.display, "get_driver", lambda: "offscreen")
        show(Display(7, fps=1000))
        pygame.quit()
        monkeypatch.delenv("SDL_VIDEODRIVER")
        monkeypatch.setattr(pygame.display, "init", lambda: None)
        with pytest.raises(RuntimeError, match="no screen"):
            show(Display(7, fps=1000))
