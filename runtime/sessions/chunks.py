"""Many rows, answered a chunk at a time, several chunks at once."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

from ..errors import BundleError, InputError
from ..process.cores import core_count

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray


def checked_chunk(chunk: int) -> int:
    """Rows a run.  Raises: InputError below 1."""
    if chunk < 1:
        raise InputError(f"chunk = {chunk}, expected at least 1; leave it out for the default")
    return chunk


def checked_threads(threads: int | None) -> int:
    """Threads to use, one a core by default.  Raises: InputError below 1."""
    if threads is None:
        return core_count()
    if threads < 1:
        raise InputError(f"threads = {threads}, expected at least 1; leave it out for the default")
    return threads


def fill_in_chunks(
    answer: Sequence[NDArray[Any]], run: Callable[[slice], Sequence[NDArray[Any]]], chunk: int, threads: int
) -> None:
    """Write ``run(rows)`` into those rows of the arrays of ``answer``, for all rows, ``chunk`` of them at a time.

    Chunks are shared out among threads: one operation of a small chunk is too short to be shared itself.
    An error of ``run`` is raised for the first chunk that has one.
    """

    def fill(start: int) -> None:
        rows = slice(start, start + chunk)
        for target, found in zip(answer, run(rows), strict=True):
            if found.shape != target[rows].shape:
                raise BundleError(
                    f"the model answers an array of shape {found.shape}, expected {target[rows].shape}; the file is "
                    "damaged: pass the .onnx file that flexpara unwrap wrote"
                )
            target[rows] = found

    starts = range(0, len(answer[0]), chunk)
    if threads == 1 or len(starts) < 2:
        for start in starts:
            fill(start)
        return
    with ThreadPoolExecutor(min(threads, len(starts))) as pool:
        for _ in pool.map(fill, starts):
            pass
