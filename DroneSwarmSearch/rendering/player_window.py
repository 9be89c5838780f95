"""The window of a `Player`: the picture, and a strip with the state and the keys below it."""

from __future__ import annotations

from collections.abc import Sequence

import pygame

from DroneSwarmSearch.rendering.labels import outcome_in_brief
from DroneSwarmSearch.rendering.painter import SIDES, Painter
from DroneSwarmSearch.rendering.palette import FAINT, GREY, INK, PAPER, WHITE, Look
from DroneSwarmSearch.rendering.player import KeyHelp, Player, Score
from DroneSwarmSearch.rendering.sprites import text_line, write
from DroneSwarmSearch.rendering.window import Window

PICTURES_PER_SECOND = 30

LONGEST_PAUSE = 0.1
"""Seconds that pass at most between two pictures; a slower machine shows slower motion."""

ALIASES = {"enter": "return", "[+]": "+", "[-]": "-", "[.]": "."}  # the keypad's names of keys

FONT, LINE, STRIP = 20, 30, 70  # of the text; the heights of a line with its margins, of the strip


class PlayerWindow(Window):
    """Shows a player, and passes it keys and time."""

    def __init__(self, grid_size: int, look: Look, reason: str) -> None:
        self._painters = {
            view: Painter(grid_size, look, view=view, reason=reason) for view in SIDES
        }
        super().__init__(self._usual_size("matrix"))

    def _usual_size(self, view: str) -> tuple[int, int]:
        """The size of the window in which a view needs no scaling."""
        width, height = self._painters[view].size
        return width, height + STRIP

    def play(self, player: Player) -> str:
        """Show a player until the user quits, and return how; a hidden one only to its end."""
        self.open()
        pygame.key.set_repeat(300, 110)  # milliseconds, for keys that are held down
        held: set[str] = set()
        shown: object = None
        view, size = "matrix", self.surface.get_size()
        while True:
            for event in pygame.event.get():
                if event.type == pygame.QUIT:
                    return "the window was closed"
                if event.type == pygame.KEYDOWN:
                    name = pygame.key.name(event.key)
                    player.press(ALIASES.get(name, name), repeated=name in held)
                    held.add(name)
                elif event.type == pygame.KEYUP:
                    held.discard(pygame.key.name(event.key))
                elif event.type == pygame.WINDOWFOCUSLOST:
                    held.clear()  # the releases of keys go to another window
                elif event.type in (pygame.VIDEOEXPOSE, pygame.WINDOWSIZECHANGED):
                    shown = None
            if player.quits:
                return "you quit"
            if player.is_at_end and self.is_hidden:
                return ""  # nobody can press a key
            if player.view != view:
                view = player.view
                if self.surface.get_size() == size:  # not resized by the user
                    self.resize(self._usual_size(view))
                    size = self.surface.get_size()
            state = player.moment, player.view, player.status, player.hint, player.shows_keys
            if state != shown:
                self._draw(player)
                shown = state
            player.advance(min(self.wait(PICTURES_PER_SECOND), LONGEST_PAUSE))

    def _draw(self, player: Player) -> None:
        frame, towards, progress = player.moment
        picture = self._painters[player.view].paint(frame, towards=towards, progress=progress)
        area = picture.get_rect()
        canvas = pygame.Surface((area.width, area.height + STRIP), 0, 32)
        canvas.blit(picture, area)
        _draw_strip(canvas, area.height, player)
        if player.shows_keys:
            veil = pygame.Surface(area.size, pygame.SRCALPHA)
            veil.fill((*INK, 150))
            canvas.blit(veil, area)
            card = _card("Keys", [(keys, details) for keys, _, details in player.keys])
            canvas.blit(card, card.get_rect(center=area.center))
        elif player.is_at_end and player.recording.scores:
            heading = ("", "result", "POS", "return")
            card = _card("Your result", [heading, *map(_score_row, player.recording.scores)])
            canvas.blit(card, card.get_rect(bottomright=area.bottomright))
        self.draw(canvas)


def _score_row(score: Score) -> tuple[str, str, str, str]:
    name, last = score
    success, total = last.probability_of_success, last.total_return
    figures = "" if success is None else f"{success:.1%}", "" if total is None else f"{total:,.0f}"
    return name, outcome_in_brief(last), *figures


def _draw_strip(canvas: pygame.Surface, top: int, player: Player) -> None:
    """A line with the state, and one with the keys, as many as fit."""
    width, margin = canvas.get_width(), FONT // 2
    canvas.fill(WHITE, (0, top, width, STRIP))
    pygame.draw.line(canvas, FAINT, (0, top), (width, top))
    colour, middle = (INK if player.hint else GREY), top + margin // 2 + LINE // 2
    write(canvas, player.hint or player.status, FONT, colour, midleft=(margin, middle))
    *others, keys, quit_key = map(_key_image, player.keys)
    left, room = margin, width - keys.get_width() - quit_key.get_width()
    for image in (*others, keys, quit_key):
        if image in (keys, quit_key) or left + image.get_width() <= room:
            canvas.blit(image, image.get_rect(midleft=(left, middle + LINE)))
            left += image.get_width()


def _key_image(key: KeyHelp) -> pygame.Surface:
    cap, meaning = text_line(key[0], FONT, INK), text_line(key[1], FONT, GREY)
    pad = FONT // 3
    box = pygame.Rect(0, 0, cap.get_width() + 2 * pad, FONT + pad)
    image = pygame.Surface((box.width + meaning.get_width() + 4 * pad, box.height), 0, 32)
    image.fill(WHITE)
    pygame.draw.rect(image, FAINT, box, border_radius=pad)
    image.blit(cap, cap.get_rect(center=box.center))
    image.blit(meaning, meaning.get_rect(midleft=(box.right + pad, box.centery)))
    return image


def _card(title: str, rows: Sequence[Sequence[str]]) -> pygame.Surface:
    """A table on a card; the columns from the third one hold numbers, aligned to the right."""
    cells = [[text_line(cell or " ", FONT, INK) for cell in row] for row in rows]
    widths = [max(cell.get_width() for cell in column) for column in zip(*cells, strict=True)]
    size = sum(widths) + FONT * (len(widths) + 1), LINE * (len(rows) + 1) + 2 * FONT
    card = pygame.Surface(size, 0, 32)
    card.fill(PAPER)
    write(card, title, FONT + FONT // 3, INK, topleft=(FONT, FONT))
    for number, row in enumerate(cells, 1):
        left, middle = FONT, FONT + LINE * number + LINE // 2
        for column, (cell, width) in enumerate(zip(row, widths, strict=True)):
            place = cell.get_rect(midleft=(left, middle))
            if column > 1:
                place.right = left + width
            card.blit(cell, place)
            left += width + FONT
    pygame.draw.rect(card, INK, card.get_rect(), width=1)
    return card
