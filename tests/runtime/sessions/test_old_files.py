"""Files that earlier versions wrote: `format_1.onnx` is one of 0.1.0 with perceptrons for two charts, three patches."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexpara.runtime.sessions.session import UnwrapSession

OLD = Path(__file__).parent / "format_1.onnx"


def test_a_file_of_format_1_answers_as_it_did() -> None:
    session = UnwrapSession(OLD)
    assert (session.metadata.format_version, session.metadata.patch_chart) == (1, (0, 1, 1))
    answer = session.unwrap(np.array([[3.0, -2.0, 7.5], [5.5, -2.0, 5.0], [1.0, -3.0, 4.0]]))
    assert answer.chart.tolist() == [1, 0, 0]
    assert answer.uv == pytest.approx(
        np.array([[0.58255786, 0.6957981], [0.2852991, 0.43329209], [0.302248, 0.34687468]]), abs=1e-5
    )
    assert answer.score == pytest.approx(np.array([0.7655584, 0.4317831, 0.733020]), abs=1e-5)
