"""Many unwraps and bakes in one process: whether memory, file handles and OpenGL objects stay flat.

    python -m benchmarks.soak [--unwraps 300] [--bakes 300] [--mesh MESH] [--record out/soak.jsonl]

Memory is compared after a tenth of the rounds (what is imported, compiled and kept for the next is there by then) and
at the end, each the median of several rounds; the exit code is 1 where it grew by more than 5 %, or where handles or
OpenGL objects grew at all.
"""

from __future__ import annotations

import argparse
import gc
import json
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from ctypes import CDLL, byref, c_uint
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median

import flexpara
from flexpara.runtime.cli.runfile import Run
from flexpara.runtime.options.unwrap import Options, Outputs
from flexpara.runtime.samples import make_sample

WARM = 0.1
"""Share of the rounds after which memory counts."""
NEAR = 10
"""Rounds whose median is taken."""
FLAT = 1.05
"""How much more memory there may be at the end."""

GENERATED = {
    "Buffer": "Buffers",
    "Framebuffer": "Framebuffers",
    "Query": "Queries",
    "Renderbuffer": "Renderbuffers",
    "Sampler": "Samplers",
    "Texture": "Textures",
    "VertexArray": "VertexArrays",
}
"""Kinds of OpenGL objects, as in `glIsQuery` and `glGenQueries`; programs and shaders are made by `glCreateProgram`."""
NAMES = 1024
"""So many of each kind are asked for at the least: some devices give the lowest free one, others never one twice."""


@dataclass(frozen=True)
class Reading:
    """What the process holds after a round.  memory: resident bytes.  objects: see `opengl_objects`."""

    kind: str
    round: int
    memory: int
    handles: int
    objects: int


def reading(kind: str, number: int) -> Reading:
    """What is held now."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return Reading(kind, number, pages * 4096, len(list(Path("/proc/self/fd").iterdir())), opengl_objects())


def opengl_objects() -> int:
    """Contexts that are kept, and names in them that OpenGL itself says are objects, whoever made and forgot them."""
    from flexpara.bake.raster.context import idle

    library = CDLL("libGL.so.1")
    count = len(idle.contexts)
    for context in idle.contexts:
        with context:
            for kind, last in _last_names(library).items():
                held = getattr(library, f"glIs{kind}")
                count += sum(held(name) & 1 for name in range(1, max(last, NAMES) + 1))
    return count


def _last_names(library: CDLL) -> dict[str, int]:
    """Of each kind of object, the name that a new one gets: it is made for that, and given back."""
    found = {}
    for kind, kinds in GENERATED.items():
        name = c_uint()
        getattr(library, f"glGen{kinds}")(1, byref(name))
        getattr(library, f"glDelete{kinds}")(1, byref(name))
        found[kind] = name.value
    program = library.glCreateProgram()
    library.glDeleteProgram(program)
    return {**found, "Program": program, "Shader": program}  # which share their names


def rounds(kind: str, count: int, work: Callable[[], object], record: Path) -> list[Reading]:
    """So many rounds, each with its reading, written down as it ends."""
    found = []
    for number in range(count):
        begin = time.perf_counter()
        work()
        found.append(reading(kind, number))
        with record.open("a", encoding="utf-8") as file:
            file.write(json.dumps({**asdict(found[-1]), "seconds": round(time.perf_counter() - begin, 3)}) + "\n")
    return found


def verdict(found: Sequence[Reading]) -> tuple[str, bool]:
    """First and last memory, handles and objects in a line, and whether they are flat."""
    warm = int(len(found) * WARM)
    first, last = found[warm : warm + NEAR], found[-NEAR:]
    memory = [median(each.memory for each in part) / 1e6 for part in (first, last)]
    handles = [part[-1].handles for part in (first, last)]
    objects = [part[-1].objects for part in (first, last)]
    flat = memory[1] <= FLAT * memory[0] and handles[1] <= handles[0] and objects[1] <= objects[0]
    grown = f"memory {memory[0]:.1f} → {memory[1]:.1f} MB ({memory[1] / memory[0] - 1:+.1%})"
    held = f"handles {handles[0]} → {handles[1]}, OpenGL objects {objects[0]} → {objects[1]}"
    return f"{len(found)} × {found[0].kind}: {grown}, {held}", flat


def small_mesh(folder: Path) -> Path:
    """A torus of some hundred faces."""
    vertices, faces = make_sample("torus", resolution=4)
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    (folder / "torus.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder / "torus.obj"


def main(words: Sequence[str] | None = None) -> int:
    """Unwraps, then bakes, each judged by itself."""
    from flexpara.__main__ import main as command
    from flexpara.__main__ import unwrap_one

    parser = argparse.ArgumentParser(prog="python -m benchmarks.soak", description=__doc__)
    parser.add_argument("--unwraps", type=int, default=300)
    parser.add_argument("--bakes", type=int, default=300)
    parser.add_argument("--mesh", type=Path)
    parser.add_argument("--record", type=Path, default=Path("out/soak.jsonl"))
    asked = parser.parse_args(words)
    asked.record.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        mesh = asked.mesh or small_mesh(folder)
        run = Run(mesh.absolute(), folder / "out", Options(size=256), Outputs())
        unwrap_one(run)
        baked = ["bake", str(run.output / f"{mesh.stem}.glb"), "-o", str(folder / "baked")]
        baked += ["--size", "256", "--maps", "normal,ao", "--rays", "16", "--quiet", "--force"]
        found = {"unwrap": rounds("unwrap", asked.unwraps, lambda: unwrap_one(run), asked.record)}
        found["bake"] = rounds("bake", asked.bakes, lambda: command(baked), asked.record)
    verdicts = [verdict(each) for each in found.values() if each]
    print("\n".join(line for line, _ in verdicts), f"flexpara {flexpara.__version__}", sep="\n")
    return int(not all(flat for _, flat in verdicts))


if __name__ == "__main__":
    sys.exit(main())
