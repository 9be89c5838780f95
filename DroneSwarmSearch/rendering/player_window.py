"""The window of a `Player`: the picture, and a strip with the state and the keys below it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import accumulate

from DroneSwarmSearch.rendering._pygame import pygame
from DroneSwarmSearch.rendering.painter import Painter
from DroneSwarmSearch.rendering.palette import FAINT, GREY, INK, PAPER, WHITE
from DroneSwarmSearch.rendering.player import (
    SCORE_HEADERS,
    KeyHelp,
    Player,
    score_row,
)
from DroneSwarmSearch.rendering.sprites import text_line
from DroneSwarmSearch.rendering.window import Window, fitted

__all__ = ["PlayerWindow"]

PICTURES_PER_SECOND = 30

LONGEST_PAUSE = 0.1
"""Seconds that pass at most between two pictures; a slower machine shows slower motion."""

REPEAT_AFTER, REPEAT_EVERY = 300, 110
"""Milliseconds for keys that are held down."""

ALIASES = {"enter": "return", "[+]": "+", "[-]": "-", "[.]": "."}
"""The keypad's names of keys."""

FONT_LEAST, FONT_USUAL, FONT_MOST = 14, 20, 44
"""Font sizes of the strip, in pictures of very small, the usual and very large scale."""

VEIL = (*INK, 150)
"""The colour over the picture behind a card of text, with its opacity."""


class PlayerWindow(Window):
    """Shows a player, and passes it keys and time.

    Args:
        painter: returns the painter for a view of the player.
        title: the window's title.
    """

    def __init__(self, painter: Callable[[str], Painter], *, title: str) -> None:
        self._make_painter = painter
        self._painters: dict[str, Painter] = {}
        super().__init__(self._usual_size("matrix"), title=title)

    def __enter__(self) -> PlayerWindow:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _painter(self, view: str) -> Painter:
        if view not in self._painters:
            self._painters[view] = self._make_painter(view)
        return self._painters[view]

    def _usual_size(self, view: str) -> tuple[int, int]:
        """The size of the window in which a view needs no scaling."""
        width, height = self._painter(view).size
        return width, height + _strip_height(FONT_USUAL)

    def play(self, player: Player) -> str:
        """Show a player until the user quits, or to its end if the window is hidden.

        Returns:
            How the user quits.
        """
        self.open()
        pygame.key.set_repeat(REPEAT_AFTER, REPEAT_EVERY)
        clock = pygame.time.Clock()
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
            state = self._state(player)
            if state != shown:
                self._draw(player)
                shown = state
            seconds = clock.tick(PICTURES_PER_SECOND) / 1000
            player.advance(min(seconds, LONGEST_PAUSE))

    @staticmethod
    def _state(player: Player) -> object:
        """Equal as long as the picture need not be drawn again."""
        return (
            *(player.recording, player.moment.frame.step, player.moment.progress, player.view),
            *(player.status, player.hint, player.shows_keys, player.moment.frame.hide_persons),
        )

    # Drawing.

    def _draw(self, player: Player) -> None:
        screen = self.surface
        moment = player.moment
        painter = self._painter(moment.view)
        picture = painter.paint(moment.frame, previous=moment.previous, progress=moment.progress)
        font = self._font(painter)
        area = screen.get_rect()
        strip = pygame.Rect(0, area.height - _strip_height(font), area.width, _strip_height(font))
        area.height = max(1, strip.top)
        screen.fill(PAPER)
        screen.blit(*fitted(picture, area))
        self._draw_strip(screen, strip, player, font)
        if player.shows_keys:
            keys = [(each.keys, each.details) for each in player.keys]
            veil = pygame.Surface(area.size, pygame.SRCALPHA)
            veil.fill(VEIL)
            screen.blit(veil, area)
            _draw_card(screen, area, _card("Keys", keys, font), "center")
        elif player.is_at_end and player.recording.scores:
            scores = [SCORE_HEADERS, *map(score_row, player.recording.scores)]
            _draw_card(screen, area, _card("Your result", scores, font), "bottomright")
        pygame.display.flip()

    def _font(self, painter: Painter) -> int:
        """The font size that fits the scale of the picture."""
        width, height = self.surface.get_size()
        scale = min(width / painter.size[0], height / painter.size[1])
        return min(max(round(FONT_USUAL * scale), FONT_LEAST), FONT_MOST)

    @staticmethod
    def _draw_strip(screen: pygame.Surface, strip: pygame.Rect, player: Player, font: int) -> None:
        """A line with the state, and one with the keys, as many as fit."""
        screen.fill(WHITE, strip)
        pygame.draw.line(screen, FAINT, strip.topleft, strip.topright)
        margin, line = font // 2, font + font // 2
        top = pygame.Rect(strip.left + margin, strip.top + margin // 2, strip.width, line)
        text = text_line(player.hint or player.status, font, INK if player.hint else GREY)
        screen.blit(text, text.get_rect(midleft=top.midleft))
        left, middle = top.left, top.bottom + line // 2
        *others, keys, quit_key = (_key_image(each, font) for each in player.keys)
        room = strip.width - margin - keys.get_width() - quit_key.get_width()
        widths = accumulate(image.get_width() for image in others)
        images = [
            image for image, width in zip(others, widths, strict=True) if margin + width <= room
        ]
        for image in (*images, keys, quit_key):
            screen.blit(image, image.get_rect(midleft=(left, middle)))
            left += image.get_width()


def _strip_height(font: int) -> int:
    return font // 2 + 2 * (font + font // 2)


def _key_image(key: KeyHelp, font: int) -> pygame.Surface:
    """A key cap and what the key does."""
    cap, meaning = text_line(key.keys, font, INK), text_line(key.meaning, font, GREY)
    pad = font // 3
    box = pygame.Rect(0, 0, cap.get_width() + 2 * pad, font + pad)
    image = pygame.Surface((box.width + meaning.get_width() + 4 * pad, box.height), 0, 32)
    image.fill(WHITE)
    pygame.draw.rect(image, FAINT, box, border_radius=pad)
    image.blit(cap, cap.get_rect(center=box.center))
    image.blit(meaning, meaning.get_rect(midleft=(box.right + pad, box.centery)))
    return image


def _card(title: str, rows: Sequence[Sequence[str]], font: int) -> pygame.Surface:
    """A table on a card; the columns from the third one hold numbers, aligned to the right."""
    gap, line = font, font + font // 2
    cells = [[text_line(cell or " ", font, INK) for cell in row] for row in rows]
    widths = [max(cell.get_width() for cell in column) for column in zip(*cells, strict=True)]
    size = sum(widths) + gap * (len(widths) + 1), line * (len(rows) + 1) + 2 * gap
    card = pygame.Surface(size, 0, 32)
    card.fill(PAPER)
    card.blit(text_line(title, font + font // 3, INK), (gap, gap))
    for number, row in enumerate(cells, 1):
        left, middle = gap, gap + line * number + line // 2
        for column, (cell, width) in enumerate(zip(row, widths, strict=True)):
            place = cell.get_rect(midleft=(left, middle))
            if column > 1:
                place.right = left + width
            card.blit(cell, place)
            left += width + gap
    pygame.draw.rect(card, INK, card.get_rect(), width=1)
    return card


def _draw_card(
    screen: pygame.Surface, area: pygame.Rect, card: pygame.Surface, anchor: str
) -> None:
    """A card at an anchor of an area, such as "center"; smaller if there is no room."""
    place = card.get_rect(**{anchor: getattr(area, anchor)})
    screen.blit(*fitted(card, place if area.contains(place) else area))
