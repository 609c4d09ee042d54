"""`flexpara.xatlas` and the real one, asked alike: types, defaults, and the odd calls that callers make."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh
import xatlas as real

import flexpara.xatlas as xatlas  # pyright: ignore[reportMissingImports]  # runtime/aliases.py finds it
from flexpara.runtime.errors import FlexparaError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

BOX = trimesh.creation.box()
V, F = np.asarray(BOX.vertices), np.asarray(BOX.faces)
FLAT, TWO = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]], [[0, 1, 2], [1, 3, 2]]


def generated(module: Any) -> Any:
    atlas = module.Atlas()
    atlas.add_mesh(V, F)
    atlas.generate()
    return atlas


@pytest.mark.parametrize("name", ["ChartOptions", "PackOptions"])
def test_each_option_has_the_type_it_has_there(name: str) -> None:
    theirs, ours = getattr(real, name)(), getattr(xatlas, name)()
    fields = [field for field in dir(theirs) if not field.startswith("_")]
    assert len(fields) >= 10
    assert {field: type(getattr(ours, field)) for field in fields} == {
        field: type(getattr(theirs, field)) for field in fields
    }


def test_what_an_atlas_answers_has_the_types_it_has_there() -> None:
    def kinds(module: Any) -> dict[str, Any]:
        atlas = generated(module)
        values = {name: getattr(atlas, name) for name in dir(real.Atlas) if name[0] != "_" and name != "chart_image"}
        found: dict[str, Any] = {name: type(value) for name, value in values.items() if not callable(value)}
        chart, assigned = atlas.get_mesh_chart(0, 0), atlas.get_mesh_vertex_assignment(0)
        found |= {name: type(getattr(chart, name)).__name__ for name in dir(real.Chart) if name[0] != "_"}
        return found | {"dtypes": [array.dtype for array in (*atlas[0], *assigned, chart.faces)]}

    assert len(kinds(real)) > 9
    assert kinds(xatlas) == kinds(real)


def test_defaults_are_those_that_the_real_signatures_name() -> None:
    import inspect

    for module_name, place in (("", real), ("Atlas", real.Atlas)):
        own = getattr(xatlas, module_name) if module_name else xatlas
        for name in [name for name in dir(place) if name[0] != "_" and inspect.isroutine(getattr(place, name))]:
            said = re.findall(r"(\w+): [^,=]*(?:\[[^]]*\])*[^,=]* = (None|False|True)", getattr(place, name).__doc__)
            parameters = inspect.signature(getattr(own, name)).parameters
            for argument, default in said:
                assert str(parameters[argument].default) == default, (name, argument)


ODD_ARRAYS: dict[str, tuple[Any, Any]] = {
    "float16 and uint16": (V.astype(np.float16), F.astype(np.uint16)),
    "whole numbers and floats": ((V * 2).astype(int), F + 0.5),
    "another byte order": (V.astype(">f4"), F.astype(">i4")),
    "columns first": (np.asfortranarray(V), np.asfortranarray(F)),
    "every second": (np.repeat(V, 2, axis=0)[::2], np.repeat(F, 2, axis=1)[:, ::2]),
    "backwards": (V[::-1], F[::-1]),
    "objects": (V.astype(object), F.astype(object)),
    "text of numbers": (V.astype(str), F),
    "tuples": (tuple(map(tuple, V.tolist())), tuple(map(tuple, F.tolist()))),
    "indices that wrap": (V, np.where(F == 1, 2**32 + 1, F)),
    "empty": (np.zeros((0, 3)), np.zeros((0, 3), int)),
    "all at one point": (V * 0.0, F),
    "nothing finite": (V * np.nan, F),
    "tiny": (V * 1e-30, F),
}


@pytest.mark.parametrize(("positions", "faces"), ODD_ARRAYS.values(), ids=ODD_ARRAYS)
def test_odd_arrays_are_read_as_there(positions: Any, faces: Any) -> None:
    theirs, ours = (module.parametrize(positions, faces) for module in (real, xatlas))
    np.testing.assert_array_equal(ours[0][ours[1]], theirs[0][theirs[1]])
    assert [array.dtype for array in ours] == [array.dtype for array in theirs]


WRONG: dict[str, Callable[[Any], Any]] = {
    "text": lambda module: module.parametrize([["a", "b", "c"]], F),
    "no positions": lambda module: module.parametrize(None, F),
    "no indices": lambda module: module.parametrize(V, None),
    "ragged": lambda module: module.parametrize([[0, 0, 0], [1, 0]], F),
    "empty lists": lambda module: module.parametrize([], []),
    "flat indices": lambda module: module.parametrize(V, F.reshape(-1)),
    "quads": lambda module: module.parametrize(V, F.reshape(-1, 4)),
    "negative index": lambda module: module.parametrize(V, F - 1),
    "few normals": lambda module: module.parametrize(V, F, V[:3]),
    "wide uvs": lambda module: module.parametrize(V, F, uvs=V),
    "options in the wrong places": lambda module: module.Atlas().generate(module.PackOptions(), module.ChartOptions()),
    "options in a dictionary": lambda module: module.Atlas().generate({"max_cost": 1.0}),
    "a picture of nothing": lambda module: module.Atlas().chart_image,
    "a picture not asked for": lambda module: generated(module).chart_image,
    "another page": lambda module: generated(module).get_chart_image(1),
    "another chart": lambda module: generated(module).get_mesh_chart(0, 99),
    "flat positions as uv": lambda module: module.Atlas().add_uv_mesh(V, F),
    "uv beyond": lambda module: module.Atlas().add_uv_mesh(FLAT, [[0, 1, 9]]),
    "a folder that is not there": lambda module: module.export("/nowhere/mesh.obj", V, F),
    "uv for normals": lambda module: module.export("/nowhere/mesh.obj", V, F, FLAT),
}


@pytest.mark.parametrize("call", WRONG.values(), ids=WRONG)
def test_what_is_refused_there_is_refused_by_the_same_kind_of_error(call: Callable[[Any], Any]) -> None:
    with pytest.raises((TypeError, ValueError, RuntimeError, IndexError)) as theirs:
        call(real)
    with pytest.raises(type(theirs.value)) as ours:
        call(xatlas)
    assert isinstance(ours.value, FlexparaError)


def test_generating_again_takes_what_was_added_since() -> None:
    for module in (real, xatlas):
        atlas = generated(module)
        atlas.generate()
        assert len(atlas) == 1
        atlas.add_mesh(V, F)
        atlas.generate()
        assert len(atlas) == 2
        assert [len(indices) for _, indices, _ in atlas] == [12, 12]


@pytest.mark.parametrize("density", [-1.0, float("nan"), float("inf")])
def test_a_density_that_is_none_leaves_the_page_as_it_comes(density: float) -> None:
    atlas, options = xatlas.Atlas(), xatlas.PackOptions()
    atlas.add_mesh(V, F)
    options.texels_per_unit = density
    atlas.generate(pack_options=options)
    assert atlas.width == 1024


def test_faces_beyond_the_vertices_are_exported_as_there(tmp_path: Path) -> None:
    for module in (real, xatlas):
        module.export(str(tmp_path / f"{module.__name__}.obj"), V, F + 1)
    one, two = (path.read_text().split() for path in sorted(tmp_path.iterdir()))
    assert one == two
