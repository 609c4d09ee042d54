"""Mirrored charts: planes are found or not, and each chart's image is a chart or the chart itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.mesh import Surface
from flexpara.runtime.process.progress import Stages
from flexpara.runtime.samples import make_sample
from flexpara.train.charts.charts import Finished, chart_surface
from flexpara.train.charts.mirror import mirror_of, mirrored_charts
from flexpara.train.charts.parts import extracted
from flexpara.train.charts.proof import verify
from flexpara.train.config import FinishConfig, SymmetryConfig
from flexpara.train.finish.config import EnergyConfig
from flexpara.train.finish.pieces import Piece
from flexpara.train.search.config import StartConfig

CONFIG = FinishConfig(start=StartConfig(counts=(1.0,)))


def twice(flip: int = 0) -> Surface:
    """A bent sheet over x > 0 and its mirror image, joined along x = 0; the first so many quads have no image."""
    count = 9
    x, y = (axis.reshape(-1) for axis in np.meshgrid(*2 * [np.linspace(0.0, 1.0, count)], indexing="ij"))
    corner = np.arange(count * count).reshape(count, count)
    a, b, c, d = (part.reshape(-1) for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    points = np.stack([x, y, np.sin(2.0 * x) * (0.5 + y * y)], axis=1)
    other = faces[:, [0, 2, 1]] + count * count
    for quad in range(flip):
        p, q, r, s = (int(part[-1 - quad]) + count * count for part in (a, b, c, d))
        other[len(a) - 1 - quad], other[2 * len(a) - 1 - quad] = (p, s, q), (q, s, r)
    number = np.arange(2 * count * count)
    seam = corner[0]
    number[seam + count * count] = seam
    every = np.concatenate([points, points * [-1.0, 1.0, 1.0]])
    used, index = np.unique(number[np.concatenate([faces, other])], return_inverse=True)
    return Surface(every[used], index.reshape(-1, 3))


def charted(surface: Surface, axis: str, charts: int = 8, price: float = 0.003) -> Finished:
    config = replace(CONFIG, symmetry=SymmetryConfig(axis), slit=replace(CONFIG.slit, price=price))
    found = chart_surface(surface, charts, config, 0, Stages())
    verify(found.pieces)
    return found


def images(surface: Surface, axis: int) -> np.ndarray:
    """(f,) the face at each face's mirror image across a plane through the middle of the box."""
    places = surface.triangles.mean(axis=1)
    middle = surface.vertices.min(axis=0) + surface.vertices.max(axis=0)
    image = places.copy()
    image[:, axis] = middle[axis] - places[:, axis]
    distance = np.linalg.norm(image[:, None] - places[None], axis=2)
    assert distance.min(axis=1).max() < 1e-6
    return distance.argmin(axis=1)


def test_a_plane_is_found_across_its_axis_alone_and_says_which_faces_are_images() -> None:
    part = extracted(twice(), np.arange(len(twice().faces)))
    assert mirror_of(part.surface, SymmetryConfig("y")) is None
    found = mirror_of(part.surface, SymmetryConfig("auto"))
    assert found is not None
    assert (found.axis, found.unlike) == (0, 0)
    assert len(found.half) * 2 == len(part.surface.faces)
    bent = Surface(part.surface.vertices.copy(), part.surface.faces)
    bent.vertices[part.surface.vertices[:, 0].argmax()] += 0.01
    assert mirror_of(bent, SymmetryConfig("auto")) is None
    near = mirror_of(bent, SymmetryConfig("x"))
    assert near is not None
    assert near.unlike > 0


@pytest.mark.parametrize("price", [0.003, 0.0002])
def test_the_image_of_each_chart_is_a_chart_of_the_same_energy(price: float) -> None:
    surface = twice()
    found = charted(surface, "x", price=price)
    assert found.parts["mirrored"] == 1
    assert len(found.pieces) > 1 or price == 0.003
    image = images(surface, 0)
    of = {frozenset(piece.ids.tolist()): piece for piece in found.pieces}
    for piece in found.pieces:
        assert of[frozenset(image[piece.ids].tolist())].energy == pytest.approx(piece.energy, abs=1e-9)


def test_a_half_is_charted_by_the_search_s_energy_whatever_finishes_the_whole() -> None:
    whole, seen = twice(), list[str]()
    surface = extracted(whole, np.arange(len(whole.faces))).surface

    def solve(half: Surface, most: int, config: FinishConfig) -> list[Piece]:
        seen.append(config.energy.kind)
        return chart_surface(half, most, config, 0, Stages()).pieces

    mirror = mirror_of(surface, SymmetryConfig("x"))
    assert mirror is not None
    mirrored_charts(surface, mirror, 8, replace(CONFIG, energy=EnergyConfig("conformal")), solve)
    assert seen == ["isometric"]


def test_a_chart_across_the_plane_is_allowed_where_one_is_all_there_may_be() -> None:
    assert len(charted(twice(), "x", charts=1).pieces) == 1


def test_diagonals_that_have_no_image_are_said_and_the_charts_valid() -> None:
    found = charted(twice(flip=5), "x")
    assert any("10 faces have no mirror image" in note for note in found.notes)
    assert sum(len(piece.ids) for piece in found.pieces) == len(twice().faces)


def test_without_a_plane_charts_are_as_they_come_and_a_note_says_so() -> None:
    surface = Surface(*make_sample("torus", resolution=24))
    bent = Surface(surface.vertices + 0.3 * surface.vertices[:, [1, 2, 0]] ** 2, surface.faces)
    found, plain = charted(bent, "auto"), charted(bent, "none")
    assert found.objective == plain.objective
    assert any("no mirror image across x, y or z" in note for note in found.notes)
    assert not any("mirror" in note for note in plain.notes)


def test_what_is_looked_for_is_no_worse_than_charts_as_they_come() -> None:
    surface = Surface(*make_sample("torus", resolution=24))
    assert charted(surface, "auto").objective <= charted(surface, "none").objective
