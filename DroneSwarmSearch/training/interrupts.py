"""Ctrl-C in training scripts."""

from __future__ import annotations

import os
import signal
import threading
from typing import Any

__all__ = ["INTERRUPTED", "exit_on_interrupt", "handle_interrupts"]

INTERRUPTED = 130
"""Exit code after Ctrl-C, as in shells."""


def exit_on_interrupt(name: str) -> None:
    """Let Ctrl-C end a script with one line and code 130, until its `Run` begins.

    Call it before you import libraries that take seconds to load. Without it, Ctrl-C during
    these imports prints a long traceback.

    Args:
        name: the caller's ``__name__``; nothing changes unless it is "__main__".
    """
    if name == "__main__":
        handle_interrupts(_exit)


def _exit(*_: object) -> None:
    # An exception would pass through the code of the library that is being imported.
    os.write(2, b"interrupted before the training began; nothing has been written\n")
    os._exit(INTERRUPTED)


def handle_interrupts(handler: Any) -> None:
    """Set the handler of Ctrl-C, in the main thread, unless the program has set one."""
    in_main_thread = threading.current_thread() is threading.main_thread()
    if in_main_thread and signal.getsignal(signal.SIGINT) in (signal.default_int_handler, _exit):
        signal.signal(signal.SIGINT, handler)
