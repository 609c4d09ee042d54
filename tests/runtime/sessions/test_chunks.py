"""Rows in chunks: all of them, in place, by one thread or several; errors come from the first chunk that has one."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from flexpara.runtime.errors import InputError
from flexpara.runtime.sessions.chunks import checked_chunk, checked_threads, fill_in_chunks


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize(("rows", "chunk"), [(0, 4), (1, 4), (4, 4), (5, 4), (103, 4), (7, 100)])
def test_every_row_is_filled_by_its_own_chunk(rows: int, chunk: int, threads: int) -> None:
    answer = np.zeros((rows, 2)), np.zeros(rows, dtype=np.int64)

    def run(part: slice) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        number = np.arange(rows)[part]
        assert len(number) <= chunk
        return np.stack([number, -number], axis=1).astype(np.float64), number * 3

    fill_in_chunks(answer, run, chunk, threads)
    assert np.array_equal(answer[0], np.stack([np.arange(rows), -np.arange(rows)], axis=1))
    assert np.array_equal(answer[1], np.arange(rows) * 3)


@pytest.mark.parametrize("threads", [1, 4])
def test_the_first_error_is_raised(threads: int) -> None:
    def run(part: slice) -> tuple[NDArray[np.float64]]:
        if part.start >= 20:
            raise ValueError(f"chunk at {part.start}")
        return (np.zeros(10),)

    with pytest.raises(ValueError, match="chunk at 20"):
        fill_in_chunks((np.zeros(60),), run, 10, threads)


def test_threads_are_one_a_core_unless_asked_for() -> None:
    assert checked_threads(None) >= 1
    assert checked_threads(3) == 3
    with pytest.raises(InputError, match="threads = 0"):
        checked_threads(0)
    with pytest.raises(InputError, match="chunk = -1"):
        checked_chunk(-1)
