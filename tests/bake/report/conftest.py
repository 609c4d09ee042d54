"""What the tests of reports share: an output folder."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from resultfolder import write_result

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_result(tmp_path / "out")
