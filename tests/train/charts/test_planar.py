"""Flat regions: two triangles by hand, solids of known facets, float32 rounding, and curves that only look flat."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.geometry.triangles import edge_lengths, signed_areas
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.charts.planar import deviations, flat_regions, heights, laid_flat, least_seam
from flexpara.train.config import PlanarConfig

if TYPE_CHECKING:
    from collections.abc import Callable

CONFIG = PlanarConfig()


def regions(surface: Surface) -> np.ndarray:
    return flat_regions(surface, edge_table(surface.faces), CONFIG)


def hinge(angle: float) -> Surface:
    """Two right triangles on either side of an edge of length 2, bent by angle (radians; 0 = flat)."""
    side = [0.0, -np.cos(angle), np.sin(angle)]
    vertices = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], side])
    return Surface(vertices, np.array([[0, 1, 2], [1, 0, 3]]))


@pytest.mark.parametrize(("angle", "count"), [(0.0, 1), (1e-6, 1), (0.01, 2), (1.0, 2), (np.pi, 2)])
def test_two_triangles_are_one_region_where_they_do_not_bend(angle: float, count: int) -> None:
    assert regions(hinge(angle)).tolist() == ([0, 0] if count == 1 else [0, 1])


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("quad", 1),
        ("box", 6),
        ("fine box", 6),
        ("cube", 6),
        ("tube", 16),
        ("capped cylinder", 18),
        ("cone", 20),
        ("prism", 8),
        ("L-bracket", 8),
        ("stairs", 10),
    ],
)
def test_the_facets_of_a_solid_are_its_regions(name: str, count: int, solid: Callable[[str], Surface]) -> None:
    assert regions(solid(name)).max() + 1 == count


def test_regions_are_numbered_by_their_lowest_face(solid: Callable[[str], Surface]) -> None:
    region = regions(solid("fine box"))
    first = np.unique(region, return_index=True)[1]
    assert (np.diff(first) > 0).all()


def test_coplanar_faces_that_do_not_touch_are_two_regions(
    solid: Callable[[str], Surface], together: Callable[..., Surface]
) -> None:
    quad = solid("quad")
    assert regions(together(quad, Surface(quad.vertices + np.array([5.0, 0, 0]), quad.faces))).tolist() == [0, 0, 1, 1]


def test_the_two_sides_of_a_sheet_folded_back_are_two_regions() -> None:
    assert regions(hinge(np.pi)).tolist() == [0, 1]


@pytest.mark.parametrize("seed", range(3))
def test_facets_survive_float32_anywhere_in_space(
    seed: int, solid: Callable[[str], Surface], moved: Callable[..., Surface]
) -> None:
    """Rounded coordinates bend small faces by more than any fixed angle allows."""
    turned = moved(solid("fine box"), seed=seed)
    rounded = Surface(turned.vertices.astype(np.float32).astype(np.float64), turned.faces)
    assert regions(rounded).max() + 1 == 6


def test_a_finely_divided_curve_is_not_flat_however_little_each_edge_bends() -> None:
    sheet = Surface(*make_sample("cloth", resolution=96))
    faint = Surface(sheet.vertices * [1.0, 1.0, 1e-3], sheet.faces)
    assert regions(faint).max() + 1 > 0.9 * len(faint.faces)


def test_the_height_of_a_triangle_is_over_its_longest_side() -> None:
    surface = Surface(np.array([[0.0, 0, 0], [4, 0, 0], [1, 1.5, 0]]), np.array([[0, 1, 2]]))
    assert heights(surface) == pytest.approx([1.5])


def test_the_deviation_of_a_plane_is_zero_and_of_a_roof_half_its_height() -> None:
    flat, roof = hinge(0.0), hinge(np.pi / 2.0)
    together = np.zeros(2, dtype=np.int64)
    assert deviations(flat, together) == pytest.approx([0.0], abs=1e-12)
    assert deviations(roof, together)[0] > 0.2


def test_the_plane_of_a_facet_keeps_lengths_and_is_seen_from_outside(solid: Callable[[str], Surface]) -> None:
    box = solid("box")
    region = regions(box)
    uv = laid_flat(box, region)
    np.testing.assert_allclose(edge_lengths(uv), edge_lengths(box.triangles), atol=1e-12)
    assert (signed_areas(uv) > 0.0).all()
    for number in range(6):  # the longest edge of each side lies along u
        own = uv[region == number].reshape(-1, 2)
        assert np.ptp(own, axis=0) == pytest.approx(sorted(np.ptp(own, axis=0), reverse=True))


@pytest.mark.parametrize("size", [1.0, 7.0])
def test_each_corner_of_a_cube_lies_on_a_seam_of_half_its_shortest_edge_or_more(size: float) -> None:
    vertices, faces = make_sample("cube", resolution=4)
    cube = Surface(size * vertices, faces)
    shortest = float(edge_lengths(cube.triangles).min())
    least = 8 * shortest / 2 / np.sqrt(cube.face_areas().sum())
    assert least_seam(cube, edge_table(faces), CONFIG.bent) == pytest.approx(least)


def test_a_tube_needs_no_seam_by_its_bends() -> None:
    tube = Surface(*make_sample("tube", resolution=24))
    assert least_seam(tube, edge_table(tube.faces), CONFIG.bent) == 0.0
