"""The size of a page: what users write, and lengths in sides of it."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.errors import InputError
from flexpara.runtime.options.atlas import AtlasOptions
from flexpara.runtime.pagesize import PageSize, Size


@pytest.mark.parametrize(
    ("size", "page"),
    [(512, (512, 512)), ("512", (512, 512)), ("2048x1024", (2048, 1024)), (" 64X128 ", (64, 128)), ("3×5", (3, 5))],
)
def test_a_page_is_a_number_or_width_by_height(size: Size, page: tuple[int, int]) -> None:
    assert PageSize.of(size) == page
    assert PageSize.of(PageSize.of(size).stored) == page


@pytest.mark.parametrize("size", ["", "x", "1024x", "1024*512", "1e3", "-4x4", "1024x512x3"])
def test_other_words_are_refused_with_an_example(size: str) -> None:
    with pytest.raises(InputError, match="expected texels as 2048 or 2048x1024"):
        PageSize.of(size)


def test_lengths_are_in_sides_of_the_page() -> None:
    page = PageSize(100, 50)
    assert (page.side, page.extent.tolist(), page.shape, page.times(0.5)) == (100, [1.0, 0.5], (50, 100), (50, 25))
    assert page.even(np.array([[1.0, 1.0]])).tolist() == [[1.0, 0.5]]
    uv = np.ones((2, 2))
    assert PageSize(7, 7).even(uv) is uv
    assert PageSize.of(0).extent.tolist() == [1.0, 1.0]  # unknown


def test_options_ask_each_side_for_its_range() -> None:
    options = AtlasOptions(size="2048x1024")
    assert (options.page, options.margin) == ((2048, 1024), 8)
    for size in ("2048x8", "32768x1024"):
        with pytest.raises(InputError, match="expected 16 to 16384"):
            AtlasOptions(size=size)
    with pytest.raises(InputError, match="expected 0 to 4"):
        AtlasOptions(size="2048x32", padding=5)
