"""The window of a `Player`: the picture, and a strip with the state and the keys below it."""

from __future__ import annotations

from collections.abc import Sequence

import pygame

from DroneSwarmSearch.rendering.painter import Painter
from DroneSwarmSearch.rendering.palette import FAINT, GREY, INK, PAPER, WHITE, Look
from DroneSwarmSearch.rendering.player import Player, Score
from DroneSwarmSearch.rendering.sprites import text_line, write
from DroneSwarmSearch.rendering.window import Window

PICTURES_PER_SECOND = 30

LONGEST_PAUSE = 0.1
"""Seconds that pass at most between two pictures; a slower machine shows slower motion."""

# of the text; the heights of a line with its margins, of the strip
FONT = 20
LINE = 30
STRIP = 70
KEY_PAD = 7  # around the name of a key
CARD_COLUMNS = 140, 240, 70, 90  # widths: name, result, probability of success, return
CARD_WIDTH = sum(CARD_COLUMNS) + 3 * FONT  # with the margin to its right


class PlayerWindow(Window):
    """Shows a player, and passes it keys and time."""

    def __init__(self, grid_size: int, look: Look, reason: str) -> None:
        self._painters = {
            view: Painter(grid_size, look, view=view, reason=reason) for view in ("matrix", "both")
        }
        super().__init__(self._size_of("matrix", has_card=False))

    def _size_of(self, view: str, *, has_card: bool) -> tuple[int, int]:
        """The size with a view and its strip, and with room for a score card to the right."""
        width, height = self._painters[view].size
        if has_card:
            width += CARD_WIDTH
        return width, height + STRIP

    def play(self, player: Player) -> str:
        """Show a player until the user quits, and return how; a hidden one only to its end."""
        self.open()
        pygame.key.set_repeat(300, 110)  # milliseconds, for keys that are held down
        drawn: object = None
        layout = ("matrix", False)
        while True:
            for event in pygame.event.get():
                if event.type == pygame.QUIT:
                    return "the window was closed"
                if event.type == pygame.KEYDOWN:
                    player.press(pygame.key.name(event.key))
                elif event.type in (pygame.VIDEOEXPOSE, pygame.WINDOWSIZECHANGED):
                    drawn = None
            if player.quits:
                return "you quit"
            if player.is_at_end and self.is_hidden:
                return ""  # nobody can press a key
            has_card = player.is_at_end and bool(player.recording.scores)
            if layout != (player.view, has_card):
                layout = (player.view, has_card)
                self.resize(self._size_of(player.view, has_card=has_card))
            state = player.moment, player.view, player.status, player.hint
            if state != drawn:
                self._draw(player)
                drawn = state
            player.advance(min(self.wait(PICTURES_PER_SECOND), LONGEST_PAUSE))

    def _draw(self, player: Player) -> None:
        frame, towards, progress = player.moment
        picture = self._painters[player.view].paint(frame, towards=towards, progress=progress)
        area = picture.get_rect()
        canvas = pygame.Surface(self._size, 0, 32)
        canvas.fill(PAPER)
        canvas.blit(picture, area)
        _draw_strip(canvas, area.height, player)
        if self._size[0] > area.width:
            card = _score_card(player.recording.scores)
            canvas.blit(card, card.get_rect(midleft=area.midright))
        self.draw(canvas)


def _draw_strip(canvas: pygame.Surface, top: int, player: Player) -> None:
    """A line with the state, and one with the keys."""
    canvas.fill(WHITE, (0, top, canvas.get_width(), STRIP))
    pygame.draw.line(canvas, FAINT, (0, top), (canvas.get_width(), top))
    colour = INK if player.hint else GREY
    left = FONT // 2
    middle = top + 20
    write(canvas, player.hint or player.status, FONT, colour, midleft=(left, middle))
    for key, meaning in player.keys:
        cap = text_line(key, FONT, INK)
        box = canvas.blit(cap, cap.get_rect(midleft=(left + KEY_PAD, middle + LINE)))
        box.inflate_ip(2 * KEY_PAD, KEY_PAD)
        pygame.draw.rect(canvas, FAINT, box, width=2, border_radius=KEY_PAD)
        text = write(canvas, meaning, FONT, GREY, midleft=(box.right + KEY_PAD, box.centery))
        left = text.right + 2 * KEY_PAD


def _score_card(scores: Sequence[Score]) -> pygame.Surface:
    """The results of everybody who searched, on a card."""
    card = pygame.Surface((CARD_WIDTH - FONT, LINE * (len(scores) + 2) + FONT), 0, 32)
    card.fill(PAPER)
    write(card, "Your result", FONT + 6, INK, topleft=(FONT, FONT))
    rows = [("", "result", "POS", "return"), *map(_score_row, scores)]
    for number, row in enumerate(rows, 1):
        left = FONT
        for cell, width in zip(row, CARD_COLUMNS, strict=True):
            write(card, cell, FONT, INK, topleft=(left, FONT + LINE * number))
            left += width
    pygame.draw.rect(card, INK, card.get_rect(), width=1)
    return card


def _score_row(score: Score) -> tuple[str, str, str, str]:
    name, last = score
    success = last.probability_of_success
    total = last.total_return
    figures = "" if success is None else f"{success:.1%}", "" if total is None else f"{total:,.0f}"
    return name, last.outcome, *figures
