"""Both exported maps of one atlas: a surface point goes to its uv and chart, and from there back to itself."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import trimesh

from flexpara.export.deploy.onnxfile import export_networks
from flexpara.export.deploy.wrapfile import export_wrap
from flexpara.export.graph.metadata import PlacedCharts
from flexpara.runtime.io.meshfile import asset_from_arrays
from flexpara.runtime.mesh import Asset, Atlas, Charts, Frame, Surface
from flexpara.runtime.pack.packing import pack
from flexpara.runtime.samples import make_sample
from flexpara.runtime.sessions.session import UnwrapSession
from flexpara.runtime.sessions.wrapagreement import inverse_agreement
from flexpara.runtime.sessions.wrapsession import WrapSession
from flexpara.train.deploy.config import FitConfig
from flexpara.train.deploy.fit import fit_networks
from flexpara.train.deploy.fit_wrap import fit_wrap
from flexpara.train.finish.fallback import unwrapped_by_xatlas
from flexpara.train.pipeline import as_charts


def torus() -> tuple[Asset, Charts]:
    """A torus slit open into one chart (R · long way, r · short way)."""
    across, rows = 48, 96
    corner = np.arange(across * rows).reshape(rows, across)
    nxt, up = np.roll(corner, -1, axis=0), np.roll(corner, -1, axis=1)
    both = np.roll(nxt, -1, axis=1)
    faces = np.stack([corner, nxt, both, corner, both, up], axis=-1).reshape(-1, 3)
    i, j = np.divmod(np.arange(across * rows), across)
    long, short = i * 2.0 * np.pi / rows, j * 2.0 * np.pi / across
    radius = 6.5 + 2.5 * np.cos(short)
    positions = np.stack([100.0 + radius * np.cos(long), radius * np.sin(long), 2.5 * np.sin(short) - 9.0], axis=1)
    cell = np.stack([i[faces[::2, 0]], j[faces[::2, 0]]], axis=1).repeat(2, axis=0)
    steps = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]])
    grid = cell[:, None] + np.tile(steps, (len(cell) // 2, 1, 1))
    uv = grid * [6.5 * 2.0 * np.pi / rows, 2.5 * 2.0 * np.pi / across]
    none = np.zeros(len(faces), np.int64)
    charts = Charts(none, uv, none, np.zeros(1, np.int64), ("slit",))
    return asset_from_arrays(positions, faces), charts


def sphere() -> tuple[Asset, Charts]:
    """A sphere in six charts: the sides of a cube, flattened by gnomonic angles."""
    vertices, faces = make_sample("sphere", resolution=48)
    asset = asset_from_arrays(3.0 * vertices + [1.0, 2.0, 3.0], faces)
    middle = Surface(vertices, faces).triangles.mean(axis=1)
    axis = np.abs(middle).argmax(axis=1)
    sign = np.sign(np.take_along_axis(middle, axis[:, None], axis=1))[:, 0]
    corner = vertices[faces]
    x, u, v = (np.take_along_axis(corner, ((axis + i) % 3)[:, None, None], axis=2)[..., 0] for i in range(3))
    uv = 3.0 * np.stack([np.arctan2(u, np.abs(x)) * sign[:, None], np.arctan2(v, np.abs(x))], axis=2)
    side = axis * 2 + (sign > 0.0)
    return asset, Charts(side, uv, side, np.arange(6), ("slim",) * 6)


def real(path: Path) -> tuple[Asset, Charts]:
    """A real mesh in the charts of xatlas."""
    mesh = cast("trimesh.Trimesh", trimesh.load_mesh(path, process=False, skip_materials=True))
    asset = asset_from_arrays(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    frame = Frame.of(asset.surface.vertices)
    ball = Surface(frame.apply(asset.surface.vertices), asset.surface.faces)
    pieces = unwrapped_by_xatlas(ball, np.arange(len(ball.faces)), float(ball.face_areas().sum()))
    charts = as_charts(ball, cast("Any", SimpleNamespace(pieces=pieces)))
    return asset, dataclasses.replace(charts, corner_uv=charts.corner_uv * frame.scale)


def both_ways(asset: Asset, charts: Charts, folder: Path) -> tuple[UnwrapSession, WrapSession, Atlas, Frame]:
    """The two sessions of an atlas."""
    frame = Frame.of(asset.surface.vertices)
    ball = Surface(frame.apply(asset.surface.vertices), asset.surface.faces)
    atlas = pack(asset, charts, size=512, padding=2).atlas

    def silence(*_: Any, **__: Any) -> None:
        """Progress that nobody watches."""

    placed = PlacedCharts(frame, atlas, charts)
    export_networks(fit_networks(ball, charts, FitConfig(), 0), placed, folder / "a.onnx")
    inverse = fit_wrap(ball, charts, atlas.corner_uv, progress=silence)
    export_wrap(inverse, placed, folder / "a.wrap.onnx")
    return UnwrapSession(folder / "a.onnx"), WrapSession(folder / "a.wrap.onnx"), atlas, frame


@pytest.mark.parametrize("name", ["sphere", "torus", "spot"])
def test_there_and_back_again(name: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    """Surface point → uv and chart → surface point; and the inverse on its own."""
    makers: dict[str, Callable[[], tuple[Asset, Charts]]] = {
        "sphere": sphere,
        "torus": torus,
        "spot": lambda: real(request.getfixturevalue("models") / "spot.obj"),
    }
    asset, charts = makers[name]()
    there, back, atlas, frame = both_ways(asset, charts, tmp_path)
    agreement = inverse_agreement(back, asset.surface, atlas, count=50_000)
    assert agreement.rms < 2e-3
    assert agreement.p99 < 5e-3
    assert agreement.normal_mean < np.deg2rad(2.0)
    rng = np.random.default_rng(0)
    face = rng.integers(len(asset.faces), size=3000)
    points = np.einsum("nc,ncx->nx", rng.dirichlet(np.ones(3), size=3000), asset.surface.triangles[face])
    found = there.unwrap(points)
    gap = np.linalg.norm(back.wrap(found.uv, found.chart).points - points, axis=1) / frame.scale
    assert np.median(gap) < 1e-3
    assert (gap < 0.01).mean() > 0.99
