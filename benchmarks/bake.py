"""The baker's table, each row beside its peer of the same run: `python -m benchmarks.bake [MESH]`.

Ambient occlusion: the peer is a loop that only calls the library,
with batches made beforehand, the same batches as flexpara's.  High to low: MESH decimated to --faces, unwrapped by
flexpara, baked; both surfaces are then seen by orthographic cameras along the six axes, and the normals compared,
those of the low-poly mesh without and with its map.  Angles are in degrees, over pixels that both surfaces cover.
"""

from __future__ import annotations

import argparse
import importlib.util
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from benchmarks.raster import COMMAND_BAR, RATE_BAR, command_seconds, drawing_rates
from benchmarks.unwrap import ROOT, header, timed
from flexpara.bake.baker import bake
from flexpara.bake.files.images import write_texture
from flexpara.bake.highpoly.cage import CageSettings
from flexpara.bake.highpoly.highmaps import HighSource
from flexpara.bake.highpoly.highmesh import atlas_of
from flexpara.bake.maps.occlusion import ambient_occlusion, starting_points
from flexpara.bake.maps.rays import BATCH, RayScene, RaySettings, cosine_directions, pattern_of, sphere_patterns
from flexpara.bake.maps.tangents import vertex_tangents
from flexpara.bake.raster.context import open_context
from flexpara.bake.raster.gbuffer import rasterize
from flexpara.runtime.geometry.normals import smooth_normals
from flexpara.runtime.io.meshfile import asset_from_arrays, load_asset
from flexpara.runtime.io.ply.write import write_ply
from flexpara.runtime.mesh import Frame
from flexpara.runtime.pack.packing import atlas_from_uv

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from flexpara.bake.raster.gbuffer import GBuffer
    from flexpara.runtime.mesh import Asset, Atlas, Surface

SHARE_BAR, SECONDS_BAR, ANGLE_BAR = 0.8, 8.0, 2.0
LARGE = 4096
SPARSE = 8
"""The bare loops trace every so manieth batch."""
BANDS = 8
COLUMNS = ("work", "tool", "seconds", "M rays or texels/s", "× peer", "mean °", "median °", "bar")


class Row(NamedTuple):
    """One line of the table; what a tool has not is empty."""

    work: str
    tool: str
    seconds: float | None = None
    rate: float | None = None
    share: float | None = None
    mean: float | None = None
    median: float | None = None
    bar: str = ""

    def line(self) -> str:
        """Markdown."""
        cells = [value if isinstance(value, str) else "" if value is None else f"{value:.3g}" for value in self]
        return f"| {' | '.join(cells)} |"


def batches(gbuffer: GBuffer, atlas: Atlas, asset: Asset, count: int) -> Iterator[tuple[Any, Any]]:
    """Every SPARSE-th batch of ambient occlusion's rays: origins and directions (r, 3)."""
    frame, patterns = Frame.of(asset.surface.vertices), sphere_patterns(count, 0)
    texels, step = gbuffer.texels, BATCH // count
    for start in range(0, len(texels), SPARSE * step):
        chosen = texels[start : start + step]
        origin, normal = starting_points(gbuffer, atlas, asset, frame, chosen)
        direction = cosine_directions(patterns, pattern_of(gbuffer.image_texels(chosen), gbuffer.page.width), normal)
        yield np.repeat(origin, count, axis=0), direction.reshape(-1, 3)


def bare_lagrange(scene: RayScene, rays: Iterator[tuple[Any, Any]]) -> tuple[int, float]:
    """Rays and seconds of nothing but the library's occlusion query."""
    count, seconds = 0, 0.0
    for origin, direction in rays:
        start = time.perf_counter()
        scene.caster.occluded(origin, direction)
        seconds += time.perf_counter() - start
        count += len(origin)
    return count, seconds


def bare_embreex(surface: Surface, rays: Iterator[tuple[Any, Any]]) -> tuple[int, float]:
    """The same with embreex, which traces on one core; a few batches."""
    scene = import_module("embreex.rtcore_scene").EmbreeScene()  # optional: static tools need not find it
    corners = Frame.of(surface.vertices).apply(surface.triangles).astype(np.float32)
    import_module("embreex.mesh_construction").TriangleMesh(scene, corners)
    count, seconds = 0, 0.0
    for origin, direction in islice(rays, 4):
        start = time.perf_counter()
        scene.run(origin, direction, query="OCCLUDED")
        seconds += time.perf_counter() - start
        count += len(origin)
    return count, seconds


def whole_gbuffer(atlas: Atlas, size: int) -> GBuffer:
    """The G-buffer of the whole image."""
    with open_context() as context:
        return rasterize(context, atlas, size)


def occlusion_rows(atlas: Atlas, asset: Asset, size: int, count: int, blender: str | None) -> Iterator[Row]:
    """Rays a second.  The image is baked in bands, the bare loop before and after each: other work hits both alike."""
    work = f"AO {size}², {count} rays"
    scene, whole = RayScene.of(asset.surface), whole_gbuffer(atlas, size)
    bare, own = np.zeros(2), np.zeros(2)
    for rows in np.array_split(np.arange(size), BANDS):
        band = band_of(whole, int(rows[0]), int(rows[-1]) + 1)
        bare += bare_lagrange(scene, batches(band, atlas, asset, count))
        start = time.perf_counter()
        ambient_occlusion(band, atlas, asset, RaySettings(count), scene=scene)
        own += len(band.texels) * count, time.perf_counter() - start
        bare += bare_lagrange(scene, batches(band, atlas, asset, count))
    if importlib.util.find_spec("embreex"):
        rays, seconds = bare_embreex(asset.surface, batches(whole, atlas, asset, count))
        yield Row(work, "embreex, bare loop", rate=rays / seconds / 1e6)
    yield Row(work, "lagrange, bare loop", rate=bare[0] / bare[1] / 1e6)
    if blender:
        _, seconds = by_blender(blender, atlas, asset, None, size=size, samples=count, reach=0.0)
        yield Row(work, "Blender, Cycles", seconds, own[0] / seconds / 1e6, bar=f"flexpara × {seconds / own[1]:.1f}")
    share = float((own[0] / own[1]) / (bare[0] / bare[1]))
    bar = f"≥ {SHARE_BAR} × lagrange: {'met' if share >= SHARE_BAR else 'missed'}"
    yield Row(work, "flexpara", float(own[1]), float(own[0] / own[1] / 1e6), share, bar=bar)


def by_blender(
    python: str, atlas: Atlas, asset: Asset, high: Asset | None, *, size: int, samples: int, reach: float
) -> tuple[NDArray[np.float32], float]:
    """(image (h, w, 3), seconds) of Cycles on the CPU: ambient occlusion, or tangent-space normals of `high`."""
    surface, none = asset.surface, np.zeros((0, 3))
    with tempfile.TemporaryDirectory() as folder:
        given, result = Path(folder) / "meshes.npz", Path(folder) / "result.npz"
        np.savez(
            given,
            vertices=surface.vertices,
            faces=surface.faces,
            corner_uv=atlas.corner_uv,
            corner_normals=atlas.normals[atlas.faces],
            high_vertices=none if high is None else high.surface.vertices,
            high_faces=none if high is None else high.surface.faces,
            kind="AO" if high is None else "NORMAL",
            size=size,
            samples=samples,
            reach=reach,
        )
        command = [python, str(ROOT / "benchmarks" / "blender_bake.py"), str(given), str(result)]
        subprocess.run(command, check=True, capture_output=True)
        with np.load(result, allow_pickle=False) as found:
            return found["image"], float(found["seconds"])


def band_of(gbuffer: GBuffer, first: int, last: int) -> GBuffer:
    """Rows first to last of a G-buffer."""
    parts = {name: getattr(gbuffer, name)[first:last] for name in ("position", "normal", "second", "third", "face")}
    return replace(gbuffer, **parts, row=gbuffer.row + first, size=gbuffer.page)


def high_rows(atlas: Atlas, low: Asset, high: Asset, size: int, cage: float, blender: str | None) -> Iterator[Row]:
    """Seconds from meshes in memory to the PNG file, and what cameras see."""
    work = f"normals {len(high.faces)} → {len(low.faces)} faces, {size}²"
    start = time.perf_counter()
    source = HighSource([high], CageSettings(cage))
    texture = bake(atlas, low, [source.find_map("normal")], size=size)["normal"]
    with tempfile.TemporaryDirectory() as folder:
        write_texture(texture, Path(folder) / "normal.png")
    seconds = time.perf_counter() - start
    plain, mapped = seen_errors(atlas, low, high, texture.pixels)
    yield Row(work, "low-poly alone", mean=float(plain.mean()), median=float(np.median(plain)))
    if blender:
        reach = cage * float(np.linalg.norm(np.ptp(low.surface.vertices, axis=0)))
        image, theirs = by_blender(blender, atlas, low, high, size=size, samples=1, reach=reach)
        _, seen_there = seen_errors(atlas, low, high, image * 2 - 1)
        yield Row(work, "Blender, Cycles", theirs, mean=float(seen_there.mean()), median=float(np.median(seen_there)))
    met = seconds <= SECONDS_BAR and mapped.mean() <= ANGLE_BAR
    bar = f"≤ {SECONDS_BAR} s, ≤ {ANGLE_BAR}°: {'met' if met else 'missed'}"
    missed = source.report()["missed_share"]
    tool = f"flexpara ({missed:.1%} of texels missed)"
    yield Row(work, tool, seconds, mean=float(mapped.mean()), median=float(np.median(mapped)), bar=bar)


def seen_errors(
    atlas: Atlas, low: Asset, high: Asset, image: NDArray[np.float32], *, pixels: int = 512
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Angles (p,) in degrees between the normals seen on both meshes, without and with the normal map (h, w, 3)."""
    frame = Frame.of(high.surface.vertices)
    frames = np.column_stack([atlas.normals, vertex_tangents(atlas)])
    true_normals = smooth_normals(high.surface)
    scenes = RayScene.of(low.surface, frame), RayScene.of(high.surface, frame)
    plain, mapped = list[Any](), list[Any]()
    for axis in range(3):
        for side in (-1.0, 1.0):
            (hit, face, weight), (also, true_face, true_weight) = (seen(scene, axis, side, pixels) for scene in scenes)
            both = hit & also
            axes = np.einsum("pc,pci->pi", weight[both], frames[atlas.faces[face[both]]])
            uv = np.einsum("pc,pci->pi", weight[both], atlas.corner_uv[face[both]])
            corners = high.surface.faces[true_face[both]]
            true = np.einsum("pc,pci->pi", true_weight[both], true_normals[corners])
            plain.append(angles(axes[:, :3], true))
            mapped.append(angles(decoded(sampled(image, uv), axes), true))
    return np.concatenate(plain), np.concatenate(mapped)


def seen(scene: RayScene, axis: int, side: float, pixels: int) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """What a camera on an axis sees of the unit ball: hit (p,), face (p,), barycentric weights (p, 3)."""
    place = (np.arange(pixels, dtype=np.float32) + 0.5) / pixels * 2 - 1
    origin, direction = np.zeros((2, pixels**2, 3), np.float32)
    origin[:, (axis + 1) % 3], origin[:, (axis + 2) % 3] = np.repeat(place, pixels), np.tile(place, pixels)
    origin[:, axis], direction[:, axis] = 3.0 * side, -side
    hits = scene.cast(origin, direction)
    return hits.hit, hits.face, np.stack([1 - hits.second - hits.third, hits.second, hits.third], axis=1)


def sampled(image: NDArray[np.float32], uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """(p, c): bilinear look-up of (h, w, c), row 0 = top, at uv (p, 2), v up."""
    size = len(image)
    place = np.stack([(1 - uv[:, 1]) * size, uv[:, 0] * size], axis=1) - 0.5
    first = np.clip(np.floor(place).astype(np.int64), 0, size - 2)
    down, across = (place - first).T[..., None]
    (row, column), below, right = first.T, first[:, 0] + 1, first[:, 1] + 1
    upper = image[row, column] * (1 - across) + image[row, right] * across
    return upper * (1 - down) + (image[below, column] * (1 - across) + image[below, right] * across) * down


def decoded(local: NDArray[np.float64], axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """(p, 3) object-space normals of tangent-space ones in frames (p, 7), as a MikkTSpace renderer does."""
    normal, tangent = axes[:, :3], axes[:, 3:6]
    return (
        local[:, :1] * tangent
        + local[:, 1:2] * np.sign(axes[:, 6:]) * np.cross(normal, tangent)
        + local[:, 2:] * normal
    )


def angles(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """(p,) degrees between vectors (p, 3)."""
    lengths = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
    return np.degrees(np.arccos(np.clip(np.einsum("pi,pi->p", first, second) / lengths, -1.0, 1.0)))


def decimated(surface: Surface, faces: int, folder: Path, size: int) -> Asset:
    """The surface with so many faces left, by quadric error, unwrapped."""
    vertices, index, *_ = import_module("igl").qslim(surface.vertices, surface.faces, faces)
    write_ply(atlas_of(asset_from_arrays(vertices, index), 0.0), folder / "low.ply")
    return unwrapped(folder / "low.ply", folder, size)


def raster_rows(atlas: Atlas, mesh: Path, folder: Path) -> Iterator[Row]:
    """Drawing at 4096², beside a bare draw; then the whole command."""
    rates = drawing_rates(atlas, LARGE)
    work, met = f"position + normal {LARGE}², drawn and read", "met" if rates.own >= RATE_BAR else "missed"
    yield Row(work, "moderngl, bare draw", rate=rates.bare)
    yield Row(work, "flexpara", rate=rates.own, share=rates.own / rates.bare, bar=f"≥ {RATE_BAR:.0f} M/s: {met}")
    seconds = command_seconds(mesh, folder, LARGE)
    met = "met" if seconds <= COMMAND_BAR else "missed"
    work = f"flexpara bake --size {LARGE}, PNG and EXR written"
    yield Row(work, "flexpara", seconds, bar=f"≤ {COMMAND_BAR:.0f} s: {met}")


def unwrapped(path: Path, folder: Path, size: int) -> Asset:
    """The mesh of a file, unwrapped by flexpara's command line."""
    command = ["-m", "flexpara", "unwrap", str(path), "-o", str(folder), "--size", str(size)]
    timed([sys.executable, *command, "--maps", "none", "--quiet", "--force"])
    return load_asset(folder / f"{path.stem}.glb")


def parse(argv: list[str] | None) -> argparse.Namespace:
    """The command line."""
    description = __doc__.splitlines()[0] if __doc__ else ""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.bake", description=description)
    bunny = ROOT.parent / "shared" / "models" / "bunny.obj"
    parser.add_argument("mesh", nargs="?", type=Path, default=bunny, help="any mesh file")
    parser.add_argument("--size", type=int, default=2048, help="texels a side")
    parser.add_argument("--rays", type=int, default=64, help="per texel")
    parser.add_argument("--faces", type=int, default=5000, help="of the low-poly mesh")
    parser.add_argument("--cage", type=float, default=0.02, help="part of the bounding box diagonal")
    parser.add_argument("--high", type=Path, help="the mesh, unwrapped before (glb); else flexpara unwraps it")
    parser.add_argument("--low", type=Path, help="a low-poly mesh with uv (glb); else the mesh is decimated, unwrapped")
    parser.add_argument("--blender-python", help="a Python that has bpy: Blender's rows are added")
    return parser.parse_args(argv)


def main(argv: list[str] | None = None) -> int:
    """Print the table, row by row; 1 when flexpara misses a bar."""
    given = parse(argv)
    about = header()
    print(f"{about['cpu']}, {about['cores']} cores · Python {about['python']} · commit {about['commit']}\n")
    print(f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}", flush=True)
    missed = 0
    with tempfile.TemporaryDirectory() as name:
        folder, source = Path(name), load_asset(given.mesh)
        full_path = given.high or folder / f"{given.mesh.stem}.glb"
        full = load_asset(given.high) if given.high else unwrapped(given.mesh, folder, given.size)
        low = load_asset(given.low) if given.low else decimated(source.surface, given.faces, folder, given.size)
        rows = occlusion_rows(atlas_from_uv(full), full, given.size, given.rays, given.blender_python)
        more = high_rows(atlas_from_uv(low), low, source, given.size, given.cage, given.blender_python)
        drawn = raster_rows(atlas_from_uv(full), full_path, folder / "maps")
        for table in (drawn, rows, more):
            for row in table:
                print(row.line(), flush=True)
                missed += row.bar.endswith("missed")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
