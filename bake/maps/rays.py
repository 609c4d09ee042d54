"""Rays on the CPU: Embree scenes of surfaces, and the directions of hemispheres.

r rays · t texels · s rays per texel · p patterns.  Rays run in the unit ball of a Frame (see runtime/mesh.py), so that
one offset suits every mesh and float32 keeps its digits; distances are in its units (multiples of Frame.scale).
Embree comes with adobe-lagrange, which hands packets of rays to all cores at once (embreex traces on one).

Cosine-weighted directions need no tangent frame: where q is uniform on the unit sphere, n + q is distributed by the
cosine to n (Shirley and Morley 2003).  It is not of unit length.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from ...runtime.errors import InputError, MissingDependencyError
from ...runtime.mesh import Frame
from ...runtime.process.cores import core_count

try:
    import lagrange
except ImportError as error:
    raise MissingDependencyError(
        f"lagrange cannot be imported ({error}), rays are cast with it: pip install 'flexpara[bake]'"
    ) from error

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Surface

BATCH = 1 << 18
"""Rays handed over at once: about 7 MB, which is what stays in caches."""
MOST_WORKERS = 8
"""Threads that make rays while Embree traces those of the others."""
MOST_RAYS = 4096
TILE = 8
"""Texels with the same coordinates modulo TILE share a pattern."""
GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))

Progress = Callable[[int, int], None]
Found = TypeVar("Found")

_thread = threading.local()


@dataclass(frozen=True)
class RaySettings:
    """How rays are cast.

    count: per texel, 1 to 4096.  distance: how far an occluder counts, source units; infinite for any distance.
    seed: of the patterns; same seed, same map.  progress: called as progress(done, total), in texels.
    Raises: InputError for a count, distance or seed out of range.
    """

    count: int = 64
    distance: float = float("inf")
    seed: int = 0
    progress: Progress | None = None

    def __post_init__(self) -> None:
        if not 1 <= self.count <= MOST_RAYS:
            raise InputError(f"{self.count} rays a texel: expected 1 to {MOST_RAYS}; pass 64, or 256 for less noise")
        if not self.distance > 0.0:
            raise InputError(f"ray distance {self.distance}: expected more than 0 source units; leave it out for any")
        if self.seed < 0:
            raise InputError(f"seed {self.seed}: expected 0 or more; pass another seed")


@dataclass(frozen=True, eq=False)
class Hits:
    """Where rays end, or the nearest points of queries.

    hit: (r,) bool.  face: (r,) int64, 0 without a hit.  second, third: (r,) float32 barycentric weights of corners 1
    and 2.  distance: (r,) float32, in lengths of the ray's direction (rays) or units of the ball (points).
    """

    hit: NDArray[np.bool_]
    face: NDArray[np.int64]
    second: NDArray[np.float32]
    third: NDArray[np.float32]
    distance: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class RayScene:
    """A surface ready for rays.  Queries run on all cores and may come from several threads at once."""

    frame: Frame
    caster: Any

    @classmethod
    def of(cls, surface: Surface, frame: Frame | None = None) -> RayScene:
        """The scene of a surface, in a frame (its own unless given)."""
        frame = frame if frame is not None else Frame.of(surface.vertices)
        mesh = lagrange.SurfaceMesh()
        mesh.add_vertices(np.ascontiguousarray(frame.apply(surface.vertices), np.float64))
        mesh.add_triangles(np.ascontiguousarray(surface.faces, np.uint32))
        return cls(frame, apart(lambda: _caster(mesh)))

    def occluded(
        self, origin: NDArray[np.float32], direction: NDArray[np.float32], reach: NDArray[np.float32] | None = None
    ) -> NDArray[np.bool_]:
        """(r,) bool: whether anything lies on rays (r, 3), within reach (r,) lengths of their directions."""
        return apart(lambda: self.caster.occluded(origin, direction, None, reach))

    def cast(
        self, origin: NDArray[np.float32], direction: NDArray[np.float32], reach: NDArray[np.float32] | None = None
    ) -> Hits:
        """First hits of rays (r, 3), within reach (r,) lengths of their directions."""
        return _hits(found := apart(lambda: self.caster.cast(origin, direction, None, reach)), found.ray_depth)

    def cast_facing(
        self, origin: NDArray[np.float32], direction: NDArray[np.float32], reach: NDArray[np.float32]
    ) -> tuple[Hits, NDArray[np.bool_]]:
        """As `cast`, and whether each ray (r,) meets the front of the face, the side its normal points to."""
        found = apart(lambda: self.caster.cast(origin, direction, None, reach))
        return _hits(found, found.ray_depth), np.einsum("ri,ri->r", found.normal, direction) < 0.0

    def nearest(self, points: NDArray[np.float32]) -> Hits:
        """Nearest surface points of points (r, 3)."""
        return _hits(found := apart(lambda: self.caster.closest_point(points)), found.distance)


def _caster(mesh: Any) -> Any:
    casting = lagrange.raycasting
    caster = casting.RayCaster(casting.SceneFlags.Robust, casting.BuildQuality.High)
    caster.add_mesh(mesh)
    caster.commit_updates()
    return caster


def apart(task: Callable[[], Found]) -> Found:
    """What a task of the library returns, run in a thread that ends with it.

    The library leaves the thread that calls it with denormal numbers flushed to zero, for good; in such a thread
    scipy's KDTree runs into a segmentation fault.
    """
    if getattr(_thread, "expendable", False):
        return task()
    with ThreadPoolExecutor(1, initializer=_mark) as pool:
        return pool.submit(task).result()


def _mark() -> None:
    """This thread is used for rays alone."""
    _thread.expendable = True


def _hits(found: Any, distance: NDArray[np.float32]) -> Hits:
    """The library's result, copied out of its hands."""
    hit = np.array(found.hit, bool)
    weights = np.asarray(found.barycentric_coord, np.float32)
    face = np.where(hit, found.facet_index, 0).astype(np.int64)
    return Hits(hit, face, weights[:, 0].copy(), weights[:, 1].copy(), np.array(distance, np.float32))


def sphere_patterns(count: int, seed: int) -> NDArray[np.float32]:
    """(TILE², count, 3) float32: point sets on the unit sphere, each evenly spread and turned at random.

    Spherical Fibonacci points: each stands for an equal area (Marques et al. 2013), so a pattern is a stratified
    sample; a random turn makes it an unbiased one.
    """
    index = np.arange(count) + 0.5
    height, angle = 1.0 - 2.0 * index / count, index * GOLDEN_ANGLE
    ring = np.sqrt(1.0 - height * height)
    points = np.stack([ring * np.cos(angle), ring * np.sin(angle), height], axis=1)
    turns = random_rotations(TILE * TILE, np.random.default_rng(seed))
    return np.ascontiguousarray(np.einsum("pij,sj->psi", turns, points), np.float32)


def random_rotations(count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """(count, 3, 3) rotation matrices, uniformly distributed: unit quaternions of normal numbers."""
    w, x, y, z = (quaternions := rng.normal(size=(4, count))) / np.linalg.norm(quaternions, axis=0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def pattern_of(texels: NDArray[np.int64], width: int) -> NDArray[np.int64]:
    """(t,) index of the pattern of flat texel indices in an image of that width."""
    return (texels // width % TILE) * TILE + texels % width % TILE


def cosine_directions(
    patterns: NDArray[np.float32], which: NDArray[np.int64], axis: NDArray[np.float32]
) -> NDArray[np.float32]:
    """(t, s, 3) float32 directions, cosine-weighted about unit axes (t, 3), lengths in [0, 2]."""
    direction = np.take(patterns, which, axis=0)
    direction += axis[:, None]
    return direction


def in_batches(
    work: Callable[[NDArray[np.int64]], None], texels: NDArray[np.int64], size: int, progress: Progress | None = None
) -> None:
    """Call work with every piece of at most `size` texels, several at once; stops early when one of them raises."""
    pieces = [texels[start : start + size] for start in range(0, len(texels), size)]
    pool = ThreadPoolExecutor(min(core_count(), MOST_WORKERS), initializer=_mark)
    try:
        done = 0
        for piece, _ in zip(pieces, pool.map(work, pieces), strict=True):
            done += len(piece)
            if progress is not None:
                progress(done, len(texels))
    finally:
        pool.shutdown(cancel_futures=True)
