"""`flexpara.xatlas` beside the real one: its names, its signatures, the ways in which others call it."""

from __future__ import annotations

import inspect
import logging
import os
import re
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh
import xatlas as real

import flexpara.xatlas as xatlas  # pyright: ignore[reportMissingImports]  # runtime/aliases.py finds it
from flexpara.export.dropin import page
from flexpara.runtime.errors import FinishError, FlexparaError, ShapeError
from flexpara.runtime.geometry.metrics import measure
from flexpara.runtime.io.meshfile import asset_from_arrays
from flexpara.runtime.process.deadline import Deadline
from flexpara.train.charts.charts import chart_surface

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from flexpara.runtime.mesh import Surface
    from flexpara.runtime.process.progress import Stages
    from flexpara.train.charts.charts import Finished
    from flexpara.train.config import FinishConfig

BOX = trimesh.creation.box()
TRIANGLE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


@pytest.fixture(autouse=True)
def fresh() -> Iterator[None]:
    """Each test has the settings as they are at first, and nothing was said."""
    xatlas.say_once.cache_clear()
    yield
    xatlas.settings.__init__()


def unwrapped(atlas: Any, positions: NDArray[Any], faces: NDArray[Any], number: int = 0) -> None:
    """What every caller relies on: dtypes, face i stays face i, uv on the page, no flips, no overlap."""
    mapping, indices, uv = atlas[number] if isinstance(atlas, xatlas.Atlas) else atlas
    assert (mapping.dtype, indices.dtype, uv.dtype) == (np.uint32, np.uint32, np.float32)
    np.testing.assert_array_equal(mapping[indices], faces)
    assert uv.min() >= 0.0
    assert uv.max() <= 1.0
    found = measure(asset_from_arrays(positions, faces).surface, uv[indices].astype(np.float64))
    assert (found.flipped_faces, found.overlap_fraction) == (0, 0.0)


def parameters(thing: Any) -> list[str]:
    """Names of the arguments that a pybind function states in its first line."""
    return [
        name for name in re.findall(r"[(,] ?(\w+): ", thing.__doc__.splitlines()[0]) if name not in ("self", "arg0")
    ]


PLACES = [real, real.Atlas, real.Chart, real.ChartOptions, real.PackOptions, real.ChartType]


@pytest.mark.parametrize("place", PLACES, ids=lambda place: place.__name__)
def test_every_public_name_of_the_real_module_is_ours_too(place: Any) -> None:
    own: Any = xatlas if place is real else getattr(xatlas, place.__name__)
    public = [name for name in dir(place) if not name.startswith("_")] + (["__len__"] if place is real.Atlas else [])
    probe = xatlas.ChartType.LSCM if own is xatlas.ChartType else own
    fields = getattr(own, "__dataclass_fields__", {})
    absent = [name for name in public if not hasattr(probe, name) and name not in fields]
    assert (len(public) > 2, absent) == (True, [])


@pytest.mark.parametrize("place", [real, real.Atlas], ids=lambda place: place.__name__)
def test_every_function_takes_the_same_arguments_in_the_same_order(place: Any) -> None:
    own: Any = xatlas if place is real else xatlas.Atlas
    names = [name for name in dir(place) if not name.startswith("_") and inspect.isroutine(getattr(place, name))]
    assert len(names) >= 2
    for name in names:
        ours = [each for each in inspect.signature(getattr(own, name)).parameters if each != "self"]
        assert ours == parameters(getattr(place, name)), name


@pytest.mark.parametrize("name", ["ChartOptions", "PackOptions"])
def test_options_start_as_they_do_there_and_refuse_what_they_do_not_know(name: str) -> None:
    theirs, ours = getattr(real, name)(), getattr(xatlas, name)()
    for field in (field for field in dir(theirs) if not field.startswith("_")):
        assert getattr(ours, field) == pytest.approx(getattr(theirs, field)), field
    with pytest.raises(AttributeError):
        ours.max_charts = 3


def test_index_then_gather_as_3d_generators_do() -> None:
    vertices, faces = BOX.vertices.astype(np.float32), BOX.faces
    mapping, indices, uv = xatlas.parametrize(vertices, faces)
    assert vertices[mapping].shape == (len(uv), 3)
    unwrapped((mapping, indices, uv), vertices, faces)


def test_indices_cast_to_uint64_of_the_same_kind() -> None:
    mapping, indices, _ = xatlas.parametrize(BOX.vertices, BOX.faces.astype(np.int32))
    assert indices.astype(np.uint64, casting="same_kind").view(np.int64).max() < len(mapping)
    assert mapping.astype(np.uint64, casting="same_kind", copy=False).view(np.int64).max() == 7


def test_options_by_setattr_and_get_mesh(caplog: pytest.LogCaptureFixture) -> None:
    atlas, charts, pack = xatlas.Atlas(), xatlas.ChartOptions(), xatlas.PackOptions()
    atlas.add_mesh(BOX.vertices, BOX.faces)
    for options, values in ((charts, {"max_iterations": 4}), (pack, {"blockAlign": True, "bruteForce": False})):
        for name, value in values.items():
            setattr(options, name, value)
    with caplog.at_level(logging.WARNING, logger="flexpara.xatlas"):
        atlas.generate(charts, pack)
        atlas.generate(charts, pack)
    assert [record.getMessage().split(" ")[0] for record in caplog.records] == [
        "ChartOptions.max_iterations",
        "PackOptions.blockAlign",
    ]
    unwrapped(atlas.get_mesh(0), BOX.vertices, BOX.faces)


def test_resolution_and_padding_and_the_first_mesh() -> None:
    atlas, options = xatlas.Atlas(), xatlas.PackOptions()
    atlas.add_mesh(BOX.vertices, BOX.faces)
    options.resolution, options.padding, options.bilinear, options.create_image = 256, 4, True, True
    assert len(atlas) == 0
    atlas.generate(pack_options=options)
    unwrapped(atlas, BOX.vertices, BOX.faces)
    assert (len(atlas), atlas.atlas_count, atlas.width, atlas.height) == (1, 1, 256, 256)
    image = atlas.chart_image
    assert (image.shape, image.dtype) == ((256, 256, 3), np.uint8)
    assert image.any(axis=2).mean() == pytest.approx(atlas.utilization, abs=0.03)
    assert not image[:3].any()
    assert atlas.texels_per_unit == pytest.approx(np.sqrt(atlas.utilization * 256**2 / 6.0), rel=1e-3)


def test_trimesh_unwraps_with_the_module_swapped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "xatlas", xatlas)
    mesh: Any = BOX.unwrap()
    np.testing.assert_allclose(mesh.triangles, BOX.triangles)
    assert mesh.visual.uv.shape == (len(mesh.vertices), 2)


def test_several_meshes_share_a_page_at_one_density() -> None:
    atlas, large = xatlas.Atlas(), BOX.vertices * 2.0
    atlas.add_mesh(BOX.vertices, BOX.faces)
    atlas.add_mesh(TRIANGLE, [[0, 0, 1]])
    atlas.add_mesh(large, BOX.faces[::-1])
    atlas.generate()
    unwrapped(atlas, BOX.vertices, BOX.faces)
    unwrapped(atlas, large, BOX.faces[::-1], 2)
    assert (len(atlas), atlas.get_mesh_chart_count(1)) == (3, 0)
    corners = np.concatenate([atlas[number][2][atlas[number][1]] for number in (0, 2)]).astype(np.float64)
    assert atlas.chart_count == atlas.get_mesh_chart_count(0) + atlas.get_mesh_chart_count(2)
    both = np.concatenate([BOX.vertices, large + 9.0]), np.concatenate([BOX.faces, BOX.faces[::-1] + 8])
    found = measure(asset_from_arrays(*both).surface, corners, size=atlas.width)
    assert (found.overlap_fraction, found.charts) == (0.0, atlas.chart_count)
    assert found.symmetric_dirichlet_mean == pytest.approx(1.0, abs=1e-4)
    assert found.texel_density_mean == pytest.approx(atlas.texels_per_unit, rel=1e-3)


def test_charts_and_assignments_say_the_same() -> None:
    atlas = xatlas.Atlas()
    for _ in range(2):
        atlas.add_mesh(BOX.vertices, BOX.faces)
    atlas.generate()
    page, chart = atlas.get_mesh_vertex_assignment(1)
    faces = [atlas.get_mesh_chart(1, number).faces for number in range(atlas.get_mesh_chart_count(1))]
    np.testing.assert_array_equal(np.sort(np.concatenate(faces)), np.arange(12))
    for number, own in enumerate(faces):
        assert set(chart[atlas[1][1][own]].ravel()) == {atlas.get_mesh_chart_count(0) + number}
    assert not page.any()


def broken_meshes() -> dict[str, tuple[Any, Any]]:
    fan = np.vstack([TRIANGLE, [[0.0, 0.0, 1.0]], [[0.0, -1.0, 0.0]]])
    return {
        "non-manifold": (fan, [[0, 1, 2], [0, 1, 3], [0, 1, 4]]),
        "degenerate and whole": (TRIANGLE, [[0, 1, 1], [0, 1, 2]]),
        "all degenerate": (TRIANGLE, [[0, 1, 1]]),
        "not finite": (np.vstack([TRIANGLE, [[np.nan, 0.0, 0.0]]]), [[0, 1, 2], [1, 2, 3]]),
        "twice": (TRIANGLE, [[0, 1, 2], [0, 2, 1], [0, 1, 2]]),
        "turned": (np.vstack([TRIANGLE, [[1.0, 1.0, 0.0]]]), [[0, 1, 2], [1, 2, 3]]),
        "no indices": (TRIANGLE, np.zeros((0, 3), dtype=np.int64)),
        "unused vertices": (np.vstack([TRIANGLE, TRIANGLE + 5.0]), [[3, 4, 5]]),
        "lists": (TRIANGLE.tolist(), [[0, 1, 2]]),
    }


@pytest.mark.parametrize(("positions", "faces"), broken_meshes().values(), ids=broken_meshes())
def test_what_xatlas_answers_we_answer(positions: Any, faces: Any) -> None:
    theirs, ours = real.parametrize(positions, faces), xatlas.parametrize(positions, faces)
    np.testing.assert_array_equal(ours[0][ours[1]], theirs[0][theirs[1]])
    assert np.isfinite(ours[2]).all()


def test_a_face_without_area_is_a_point_of_its_neighbour() -> None:
    mapping, indices, uv = xatlas.parametrize(TRIANGLE, [[0, 1, 1], [0, 1, 2]])
    assert len(np.unique(uv[indices[0]], axis=0)) == 1
    assert (uv[indices[0, 0]] == uv[indices[1, 0]]).all()
    np.testing.assert_array_equal(mapping, [0, 1, 1, 2])


@pytest.mark.parametrize(
    ("positions", "faces", "error"),
    [(TRIANGLE, [[0, 1, 5]], RuntimeError), (TRIANGLE[:, :2], [[0, 1, 2]], ValueError), (TRIANGLE, [0, 1], ValueError)],
)
def test_what_xatlas_refuses_we_refuse_in_the_same_family(positions: Any, faces: Any, error: type[Exception]) -> None:
    for module in (real, xatlas):
        with pytest.raises(error):
            module.parametrize(positions, faces)
    with pytest.raises(FlexparaError):
        xatlas.parametrize(positions, faces)


def test_numbers_beyond_the_atlas_are_index_errors() -> None:
    for module in (real, xatlas):
        atlas = module.Atlas()
        atlas.generate()
        assert (atlas.atlas_count, atlas.width, len(atlas)) == (0, 0, 0)
        for call in (atlas.get_mesh, atlas.get_utilization, atlas.get_chart_image, atlas.get_mesh_chart_count):
            with pytest.raises(IndexError):
                call(0)


def test_a_layout_is_packed_anew_in_the_charts_it_has() -> None:
    uv = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [5.0, 5.0], [7.0, 5.0], [5.0, 7.0], [5.0, 3.0]])
    faces = [[0, 1, 2], [3, 4, 5], [3, 4, 6]]
    atlas = xatlas.Atlas()
    atlas.add_uv_mesh(uv, faces, [0, 1, 1])
    atlas.generate()
    assert atlas.chart_count == 3  # the third is mirrored
    assert [atlas.get_mesh_chart(0, number).material for number in range(3)] == [0, 1, 1]
    unwrapped(atlas, uv3(uv), np.array(faces))
    with pytest.raises(RuntimeError, match="same atlas"):
        atlas.add_mesh(TRIANGLE, [[0, 1, 2]])
    with pytest.raises(ShapeError, match="one for each face"):
        xatlas.Atlas().add_uv_mesh(uv, faces, [0])


def uv3(uv: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.pad(uv, ((0, 0), (0, 1)))


def test_a_texel_density_without_a_resolution_decides_the_side() -> None:
    atlas, options = xatlas.Atlas(), xatlas.PackOptions()
    atlas.add_mesh(BOX.vertices, BOX.faces)
    options.texels_per_unit, options.padding = 100.0, 2
    atlas.generate(pack_options=options)
    assert atlas.texels_per_unit == pytest.approx(100.0, rel=0.05)
    assert 245 < atlas.width < 500


def test_padding_that_leaves_no_room_makes_the_page_larger(caplog: pytest.LogCaptureFixture) -> None:
    atlas, options = xatlas.Atlas(), xatlas.PackOptions()
    atlas.add_mesh(BOX.vertices, BOX.faces)
    options.resolution, options.padding = 16, 16
    atlas.generate(pack_options=options)
    assert atlas.width > 32
    assert "leave no room" in caplog.text


def test_the_time_budget_ends_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    ball = trimesh.creation.icosphere(subdivisions=3)
    late: list[bool] = []

    def watched(surface: Surface, charts: int, config: FinishConfig, seed: int, stage: Stages) -> Finished:
        late.append(stage.deadline.passed())
        return chart_surface(surface, charts, config, seed, stage)

    monkeypatch.setattr(page, "chart_surface", watched)
    for xatlas.settings.time_budget in (1e-9, None):
        unwrapped(xatlas.parametrize(ball.vertices, ball.faces), ball.vertices, ball.faces)
    assert late == [True, False]


def test_meshes_share_the_time_budget_by_their_faces() -> None:
    given: list[float | None] = []

    def part(deadline: Deadline) -> page.Part:
        given.append(deadline.seconds)
        return page.Part(0, np.zeros((0, 3), np.int64), None, None)

    page.parts_in_time([page.Waiting(100, part), page.Waiting(300, part)], 40.0)
    assert given == [pytest.approx(10.0, rel=0.01), pytest.approx(40.0, rel=0.01)]
    page.parts_in_time([page.Waiting(0, part), page.Waiting(5, part)], None)
    assert given[2:] == [None, None]


def test_charts_that_are_refused_are_projections_and_the_log_says_so(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def refuse(*_: object) -> None:
        raise FinishError("no valid charts")

    monkeypatch.setattr(page, "chart_surface", lambda *_, **__: refuse())
    unwrapped(xatlas.parametrize(BOX.vertices, BOX.faces), BOX.vertices, BOX.faces)
    assert "charts by projection: no valid charts" in caplog.text


def test_the_number_of_charts_can_be_set() -> None:
    xatlas.settings.charts = 1
    atlas = xatlas.Atlas()
    atlas.add_mesh(BOX.vertices, BOX.faces)
    atlas.generate()
    assert atlas.chart_count == 1


def test_export_writes_what_the_real_one_writes(tmp_path: Path) -> None:
    for name, arguments in {"all": ([[0, 1, 2]], TRIANGLE[:, :2], TRIANGLE + 1.0), "points": ()}.items():
        for module in (real, xatlas):
            module.export(str(tmp_path / f"{name}.{module.__name__}.obj"), TRIANGLE, *arguments)
        written = [path.read_text().split() for path in sorted(tmp_path.glob(f"{name}.*"))]
        assert len(written) == 2
        assert written[0] == written[1]


def test_the_real_module_is_found_from_the_root_folder() -> None:
    root = Path(__file__).resolve().parents[2]
    code = "import xatlas, flexpara.xatlas as ours, flexpara; print(xatlas.__file__[-3:], ours is flexpara.xatlas)"
    run = partial(subprocess.run, cwd=root, capture_output=True, text=True, check=True)
    done = run([sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": str(root.parent)})
    assert done.stdout.split() == [".so", "True"]
