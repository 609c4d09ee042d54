"""When a result is wanted: after some seconds, or as soon as someone asks; whoever searches looks here now and then.

The clock and the request are shared with forked copies of the process.
"""

from __future__ import annotations

import math
import mmap
import signal
import threading
import time
from collections.abc import Callable
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType

Late = Callable[[], bool]
"""Whether it is time to end."""


def never() -> bool:
    """It is never late."""
    return False


class Deadline:
    """Counts from when it is made.  seconds: the budget; None never ends by itself."""

    def __init__(self, seconds: float | None = None) -> None:
        self.seconds = seconds
        self._start = time.monotonic()
        self._asked = mmap.mmap(-1, 1)  # one byte that copies see too

    @property
    def asked(self) -> bool:
        """Whether someone asked for what there is."""
        return self._asked[0] != 0

    def ask(self) -> None:
        """Ask for what there is."""
        self._asked[0] = 1

    @property
    def left(self) -> float:
        """Seconds of the budget that are left; infinite where there is none."""
        return math.inf if self.seconds is None else self.seconds - (time.monotonic() - self._start)

    def passed(self, reserve: float = 0.0) -> bool:
        """True where someone asked, or where fewer than ``reserve`` seconds of the budget are left."""
        return self.asked or self.is_spent(reserve)

    def is_spent(self, reserve: float = 0.0) -> bool:
        """True where fewer than ``reserve`` seconds of the budget are left, whether someone asked or not."""
        return self.left <= reserve


@contextmanager
def interrupts_ask(deadline: Deadline, note: Callable[[str], None]) -> Iterator[None]:
    """Within this, the first Ctrl-C asks for what there is, and says so; the second interrupts, as ever.

    Where interrupts are held back, they are let in for as long: one that came before asks at once.
    """
    if threading.current_thread() is not threading.main_thread():  # signals are its own
        yield
        return

    def handle(_number: int, _frame: FrameType | None) -> None:
        if deadline.asked:
            raise KeyboardInterrupt
        deadline.ask()
        note("interrupted: ending with the best charts so far; interrupt again to stop at once")

    before = signal.signal(signal.SIGINT, handle)
    held_back = let_in()
    try:
        yield
    finally:
        if held_back:
            hold_back()
        signal.signal(signal.SIGINT, before)


def hold_back() -> bool:
    """Let interrupts wait, those of threads and processes that are started too; whether they did already."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        return False
    return signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})


def let_in() -> bool:
    """The opposite; whether they were held back."""
    if not hasattr(signal, "pthread_sigmask"):
        return False
    return signal.SIGINT in signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def drop_waiting() -> None:
    """Forget an interrupt that waits."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.signal(signal.SIGINT, signal.default_int_handler)
