"""A textured torus as other programs write it: seams in its old uv, all five textures; and its new atlas."""

from __future__ import annotations

from typing import Any

import numpy as np
import xatlas

from flexpara.runtime.material import Material, Picture
from flexpara.runtime.mesh import Asset, Atlas, Surface

REPEATS = (2, 1)


def torus_asset(material: Material, *, columns: int = 48, rows: int = 24) -> Asset:
    """Radii 2 and 1 about the z axis; old uv run from 0 to `REPEATS`, cut along both circles."""
    u, v = (line.reshape(-1) for line in np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1)))
    turn, lean = 2 * np.pi * u, 2 * np.pi * v
    normals = np.stack([np.cos(lean) * np.cos(turn), np.cos(lean) * np.sin(turn), np.sin(lean)], axis=-1)
    positions = normals + 2.0 * np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], axis=-1)
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).reshape(-1)
    above = first + columns + 1
    faces = np.concatenate([np.stack([first, first + 1, above + 1], 1), np.stack([first, above + 1, above], 1)])
    weld = (np.arange(len(u)) // (columns + 1) % rows) * columns + np.arange(len(u)) % (columns + 1) % columns
    order = np.unique(weld, return_index=True)[1]
    return Asset(
        positions=positions,
        faces=faces,
        weld=weld,
        surface=Surface(positions[order], weld[faces]),
        normals=normals,
        uv=np.column_stack([u, v]) * REPEATS,
        materials=(material,),
        face_material=np.zeros(len(faces), np.int64),
        stem="torus",
    )


def new_atlas(asset: Asset, size: int) -> Atlas:
    """Charts and packing by xatlas: another atlas of the same faces."""
    chart_maker = xatlas.Atlas()
    chart_maker.add_mesh(asset.positions.astype(np.float32), asset.faces.astype(np.uint32))
    pack = xatlas.PackOptions()
    pack.resolution, pack.padding, pack.bilinear = size, 4, True
    chart_maker.generate(pack_options=pack)
    source, faces, uv = chart_maker[0]
    source, faces = source.astype(np.int64), faces.astype(np.int64)
    scale = np.array([chart_maker.width, chart_maker.height]) / max(chart_maker.width, chart_maker.height)
    assert asset.normals is not None
    return Atlas(
        positions=asset.positions[source],
        faces=faces,
        uv=(uv * scale).astype(np.float32),
        normals=asset.normals[source].astype(np.float32),
        face_chart=np.zeros(len(faces), np.int64),
        source_vertex=source,
        size=size,
        padding=4,
    )


def rich_material(size: int, *, wrap: Any = ("repeat", "repeat"), **changes: Any) -> Material:
    """All five textures, none symmetric; the base colour has the spectrum of photographs (amplitude 1 / frequency)."""
    row, column = np.mgrid[0:size, 0:size] / size
    smooth = 0.5 + 0.4 * np.sin(2 * np.pi * (3 * column + row)) * np.cos(2 * np.pi * 2 * row)
    slope = np.stack(
        [0.4 * np.cos(2 * np.pi * 6 * column), 0.3 * np.sin(2 * np.pi * 4 * row), np.ones((size, size))], -1
    )
    normal = slope / np.linalg.norm(slope, axis=-1, keepdims=True)
    textures = {
        "base-color": levels(pink_noise(size)),
        "metallic-roughness": levels(np.stack([np.zeros_like(smooth), smooth, 1 - smooth], -1)),
        "normal": levels(normal * 0.5 + 0.5),
        "emissive": levels(np.stack([smooth**4, smooth**8, 0 * smooth], -1)),
        "occlusion": levels(np.stack([1 - smooth / 2] * 3, -1)),
    }
    opaque = np.full((size, size, 1), 255, np.uint8)
    pictures: Any = {slot: Picture(np.concatenate([pixels, opaque], -1), wrap) for slot, pixels in textures.items()}
    return Material(pictures=pictures, metallic=1.0, roughness=1.0, **changes)


def pink_noise(size: int) -> np.ndarray:
    """(size, size, 3) about ½, periodic."""
    spectrum = np.fft.rfft2(np.random.default_rng(0).normal(size=(size, size, 3)), axes=(0, 1))
    frequency = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None])
    noise = np.fft.irfft2(spectrum / np.maximum(frequency, 1 / size)[..., None], axes=(0, 1))
    return 0.5 + 0.18 * noise / noise.std()


def levels(values: np.ndarray) -> np.ndarray:
    """[0, 1] → uint8."""
    return np.round(np.clip(values, 0, 1) * 255).astype(np.uint8)
