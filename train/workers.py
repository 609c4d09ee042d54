"""Independent pieces of work shared between the cores: this process and forked copies of it.

libigl holds Python's lock while SLIM runs, so threads don't help; a fork costs 10 ms and hands over all inputs for
nothing, where a pool of fresh processes would import for a second.  Where there is no fork, the work is done in turn:
the results are the same.
"""

from __future__ import annotations

import os
import pickle  # only between this process and its own copies, never from a file
import select
import signal
import struct
import sys
import warnings
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from threadpoolctl import threadpool_limits

from ..runtime.errors import FinishError
from ..runtime.process.cores import core_count
from ..runtime.process.meanwhile import load_next

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

Item = TypeVar("Item")
Result = TypeVar("Result")

TICKET = struct.Struct("<H")
MOST = 16384
"""Tickets that a pipe surely holds at once (64 KiB on Linux, 16 bits each)."""


_sharing: list[bool] = []
"""Not empty while work is shared: what is shared out shares nothing itself, or copies would make copies."""


def one_thread_each() -> threadpool_limits:
    """Within this, a process multiplies matrices with one thread: copies share the cores, and sums have one order.

    OpenBLAS' threads wait for each other in a loop: two copies with two each take twice the time of two with one.
    """
    return threadpool_limits(1, user_api="blas")


class Copy(NamedTuple):
    """A forked copy of this process: its number, and the end of the pipe that its results come from."""

    process: int
    results: int


def parallel_map(
    function: Callable[[Item], Result], items: Sequence[Item], effort: Callable[[Item], float] | None = None
) -> list[Result]:
    """``[function(item) for item in items]`` on all cores this process may use.

    ``effort``: what an item may take; those of most are begun first, so that no core has one left when others are done.
    ``function`` must not use torch (its threads don't survive a fork); results must be picklable.

    Raises: what the function raises; FinishError when a copy was killed.
    """
    helpers = min(available_cores(), len(items), MOST) - 1
    if helpers < 1 or len(items) > MOST or _sharing:
        return [function(item) for item in items]
    _sharing.append(True)
    order = range(len(items)) if effort is None else sorted(range(len(items)), key=lambda n: -effort(items[n]))
    tickets = ticket_pipe(order)
    copies: list[Copy] = []
    try:
        copies += [forked(function, items, tickets) for _ in range(helpers)]
        done = worked_off(function, items, tickets)
        for copy in copies:
            done |= collected(copy)
    finally:
        _sharing.pop()
        os.close(tickets)
        for copy in copies:
            dismiss(copy)
    return [done[number] for number in range(len(items))]


class Beside(Generic[Result]):
    """One piece of work that a copy of this process does while the process itself goes on.

    Where no core is free for it, it is done when its result is asked for, and not at all where nobody asks.
    """

    def __init__(self, work: Callable[[], Result]) -> None:
        """``work``: as the function of ``parallel_map``; it shares nothing itself."""
        self._work, self._found = work, list[Result]()
        self._copy: Copy | None = None
        self._process = os.getpid()
        if available_cores() > 1 and not _sharing:
            tickets = ticket_pipe([0])
            self._copy = forked(lambda _: alone(work), [None], tickets)
            os.close(tickets)

    @classmethod
    def known(cls, result: Result) -> Beside[Result]:
        """Work that is done already."""
        done = cls.__new__(cls)
        done._work, done._found, done._copy = lambda: result, [result], None
        return done

    def result(self) -> Result:
        """What the work gives.  Raises: what it raises; FinishError when the copy was killed."""
        if not self._found:
            try:
                self._found.append(alone(self._work) if self._copy is None else collected(self._copy)[0])
            finally:
                self.end()
        return self._found[0]

    def end(self) -> None:
        """Give the work up, unless it is done; copies of this process leave each other alone."""
        copy, self._copy = self._copy, None
        if copy is not None and self._process == os.getpid():
            dismiss(copy)

    def __del__(self) -> None:
        self.end()


def alone(work: Callable[[], Result]) -> Result:
    """The result of work that is done with one thread, and shares nothing: beside others, or alone, the same."""
    _sharing.append(True)
    try:
        with one_thread_each():
            return work()
    finally:
        _sharing.pop()


def available_cores() -> int:
    """Cores for this process; 1 where it can't be forked safely (other systems than Linux)."""
    return core_count() if sys.platform == "linux" else 1


def ticket_pipe(order: Sequence[int]) -> int:
    """The reading end of a pipe with one ticket for each item, in this order: whoever is free takes the next."""
    reading, writing = os.pipe()
    os.write(writing, b"".join(TICKET.pack(number) for number in order))
    os.close(writing)
    return reading


def worked_off(function: Callable[[Item], Result], items: Sequence[Item], tickets: int) -> dict[int, Result]:
    """Results by item number, until no ticket is left."""
    done: dict[int, Result] = {}
    while ticket := os.read(tickets, TICKET.size):
        (number,) = TICKET.unpack(ticket)
        done[number] = function(items[number])
    return done


def forked(function: Callable[[Item], Result], items: Sequence[Item], tickets: int) -> Copy:
    """A copy of this process that works tickets off, sends what it found, and ends."""
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        # Python ≥ 3.12 warns of forks beside threads; the copy runs numpy and libigl only, and takes no lock
        warnings.simplefilter("ignore", DeprecationWarning)
        process = os.fork()
    if process:
        os.close(writing)
        return Copy(process, reading)
    try:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
        os.close(reading)
        answer: tuple[dict[int, Any], Exception | None] = {}, None
        try:
            answer = worked_off(function, items, tickets), None
        except Exception as error:  # raised again in the parent
            answer = {}, error
        with os.fdopen(writing, "wb") as pipe:
            pickle.dump(answer, pipe, protocol=pickle.HIGHEST_PROTOCOL)
    finally:
        os._exit(0)


def collected(copy: Copy) -> dict[int, Any]:
    """What a copy found.  Raises what its function raised, or FinishError when it ended without an answer."""
    while not select.select([copy.results], [], [], 0.0)[0] and load_next():
        pass
    with os.fdopen(os.dup(copy.results), "rb") as pipe:
        sent = pipe.read()
    if not sent:
        raise FinishError("a worker process was killed, expected results; free memory and run again")
    done, error = pickle.loads(sent)
    if error is not None:
        raise error
    return done


def dismiss(copy: Copy) -> None:
    """End a copy, if it hasn't ended, and wait for it."""
    os.close(copy.results)
    os.kill(copy.process, signal.SIGKILL)  # an ended child stays until it is waited for, so the number is still its own
    os.waitpid(copy.process, 0)
