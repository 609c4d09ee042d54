"""What went in, what came out: `python -m benchmarks.roundtrip --blender-python PATH [FOLDER_OR_FILE…]`.

Each file is unwrapped, and Blender, which shares no code with flexpara, reads it before and after: names of nodes and
materials, polygons, corner normals, and where the polygons stand at three times (skins and animations).  With
--through-blender the file goes through Blender's own glTF exporter first.  Khronos' validator judges each .glb.
Angles are in degrees, distances in units of the file's largest extent.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from .corpus.processes import ROOT

READ = (".glb", ".gltf", ".obj", ".ply", ".stl")
FOLDERS = ("scenes", "files", "simple")
CORPUS = ROOT.parent / "shared" / "corpus"
LIMIT = 300.0
"""Seconds that one program may take on one file."""
GIVEN = ("material", "DefaultMaterial")
"""Names of the material that primitives of glTF get which have none: here, and in Blender where they have colours."""
KEPT = {".obj": "obj", ".ply": "ply", ".stl": "ply"}
"""Format that a file of such an ending comes back in; glb for all others.

Not for STL: Blender takes its z as up, and of glTF y, so the same numbers stand turned there."""


@dataclass(frozen=True)
class Line:
    """A line of the table: the file, what it held, what is different in the result, what the validator said."""

    name: str
    held: str
    found: str
    errors: str

    def __str__(self) -> str:
        return f"| {self.name} | {self.held} | {self.found} | {self.errors} |"


def seen_by_blender(python: Path, path: Path, folder: Path, export: Path | None = None) -> dict[str, Any] | str:
    """The arrays and facts of `blender_scene`, or the last line of what went wrong."""
    result = folder / f"{path.name}.npz"
    script = str(Path(__file__).with_name("blender_scene.py"))
    command = [str(python), script, str(path), str(result), *([str(export)] if export else [])]
    done = subprocess.run(
        command, capture_output=True, text=True, errors="replace", check=False, timeout=LIMIT, cwd=folder
    )
    if not result.is_file():
        return f"Blender does not read it ({(done.stderr.strip().splitlines() or ['no word'])[-1][:80]})"
    with np.load(result, allow_pickle=False) as found:
        arrays = {name: found[name] for name in found.files}
    return {**arrays, "facts": json.loads(str(arrays["facts"]))}


def has_normals(path: Path) -> bool:
    """Whether the file itself holds normals of faces, as it is read without any being made."""
    from flexpara.runtime.io.anyfile import load_any
    from flexpara.runtime.mesh import Asset

    found = load_any(path, ())
    return isinstance(found, Asset) and found.normals is not None


def held(seen: dict[str, Any]) -> str:
    """What is in a file, in a few words."""
    things = [thing for thing in seen["facts"]["objects"] if thing["type"] == "MESH"]
    kinds = [thing["type"].lower() for thing in seen["facts"]["objects"] if thing["type"] != "MESH"]
    words = [f"{len(things)} meshes, {sum(thing['polygons'] for thing in things)} polygons"]
    words += [f"{len(seen['facts']['materials'])} materials"] if seen["facts"]["materials"] else []
    words += [f"1 {kind}" for kind in sorted(set(kinds))]
    words += [f"{sum(len(thing['keys']) > 0 for thing in things)} with shape keys"] * any(t["keys"] for t in things)
    return ", ".join([*words, *(["1 action"] if seen["facts"]["actions"] else [])])


def without_given(seen: dict[str, Any]) -> dict[str, Any]:
    """What was seen without the material of primitives that have none."""
    facts = seen["facts"]
    kept = [[name for name in thing.get("materials", []) if name not in GIVEN] for thing in facts["objects"]]
    things = zip(facts["objects"], kept, strict=True)
    objects = [{**thing, **({"materials": names} if "materials" in thing else {})} for thing, names in things]
    materials = {name: method for name, method in facts["materials"].items() if name not in GIVEN}
    return {**seen, "facts": {**facts, "objects": objects, "materials": materials}}


def differences(before: dict[str, Any], after: dict[str, Any]) -> str:
    """What is not the same, or the largest deviations."""
    names = [name for name in ("objects", "materials", "actions") if _named(before, name) != _named(after, name)]
    wrong = [f"{name}: {_named(before, name)} → {_named(after, name)}" for name in names]
    if any(seen.get("poses_0", np.zeros(0)).size == 0 for seen in (before, after)):
        return "; ".join([*wrong, "no polygons to compare"])
    extent = max(float(np.ptp(before["poses_0"].reshape(-1, 3), axis=0).max()), 1e-30)
    turned = moved = 0.0
    for number in range(len(before["facts"]["meshes"])):
        old, new = before[f"sizes_{number}"], after.get(f"sizes_{number}", np.zeros(0, np.int32))
        if not np.array_equal(old, new):
            wrong.append(f"{before['facts']['meshes'][number]}: {len(old)} polygons → {len(new)}")
            continue
        cosine = np.einsum("ci,ci->c", before[f"normals_{number}"], after[f"normals_{number}"])
        turned = max(turned, float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))).max(initial=0.0)))
        distance = np.linalg.norm(before[f"poses_{number}"] - after[f"poses_{number}"], axis=2)
        moved = max(moved, float(distance.max(initial=0.0)) / extent)
    own = " (the file has none: Blender's own before, flexpara's after)" if after["facts"].get("own_normals") else ""
    return "; ".join(wrong) or f"the same; normals {turned:.2g}°{own}, poses {moved:.1g}"


def _named(seen: dict[str, Any], what: str) -> Any:
    """Names that are compared: of objects with all they have but the uv sets, of materials, of actions."""
    if what != "objects":
        return sorted(seen["facts"][what])
    return [
        {key: value for key, value in thing.items() if key not in ("uv_sets", "polygons", "colors")}
        for thing in seen["facts"]["objects"]
    ]


def validated(path: Path) -> str:
    """Number of errors that Khronos' validator finds in a .glb, or why it was not asked."""
    node = shutil.which("node")
    if path.suffix != ".glb" or node is None:
        return "–"
    script = str(ROOT / "tests" / "bake" / "files" / "validate_gltf.mjs")
    done = subprocess.run([node, script, str(path)], capture_output=True, text=True, check=False, timeout=LIMIT)
    return str(json.loads(done.stdout)["numErrors"]) if done.returncode == 0 else "not asked"


def line_of(path: Path, python: Path, folder: Path, *, through: bool) -> Line:
    """Unwrap a file and compare.  through: what Blender's exporter makes of it in its place."""
    name = f"{path.parent.name}/{path.name}"
    if through:
        exported = folder / f"{path.stem}.glb"
        first = seen_by_blender(python, path, folder, exported)
        if isinstance(first, str) or not exported.is_file():
            return Line(name, str(first), "–", "–")
        path = exported
    kind = KEPT.get(path.suffix, "glb")
    output = folder / "out"
    command = [sys.executable, "-m", "flexpara", "unwrap", str(path), "-o", str(output), "--format", kind]
    command += ["--maps", "none", "--no-preview", "--size", "512"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LIMIT)
    before = seen_by_blender(python, path, folder)
    entry = before if isinstance(before, str) else held(before)
    if done.returncode != 0:
        return Line(name, entry, (done.stderr.strip().splitlines() or ["no word"])[-1][:160], "–")
    result = output / f"{path.stem}.{kind}"
    after = seen_by_blender(python, result, output)
    if isinstance(before, str) or isinstance(after, str):
        return Line(name, entry, "came back; " + (after if isinstance(after, str) else held(after)), validated(result))
    if not has_normals(path):
        after["facts"]["own_normals"] = True
    said = [text.partition("note: ")[2] for text in done.stderr.splitlines() if "note: " in text]
    report = json.loads((output / f"{path.stem}.report.json").read_text(encoding="utf-8"))
    if given := report["changes"].get("given_materials", 0):
        before, after = without_given(before), without_given(after)
        said.append(f"{given} primitives without material have glTF's default one by name")
    return Line(name, entry, "; ".join([differences(before, after), *said])[:400], validated(result))


def main(argv: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("mesh", nargs="*", type=Path, default=[CORPUS / name for name in FOLDERS])
    parser.add_argument("--blender-python", type=Path, required=True, help="a Python that has bpy")
    parser.add_argument("--through-blender", action="store_true", help="let Blender's exporter write each file first")
    given = parser.parse_args(argv)
    probe = [str(given.blender_python), "-c", "import bpy"]
    if not given.blender_python.is_file() or subprocess.run(probe, capture_output=True, check=False).returncode:
        remedy = "python3.11 -m venv v; v/bin/pip install bpy; --blender-python v/bin/python"
        print(f"{given.blender_python} has no bpy, nothing is compared: {remedy}")
        return 0
    print("| file | what went in | what came out | errors |\n|---|---|---|---|")
    for entry in given.mesh:
        for path in sorted(entry.rglob("*")) if entry.is_dir() else [entry]:
            if path.suffix.lower() in READ:
                with TemporaryDirectory() as folder:
                    line = line_of(path, given.blender_python.absolute(), Path(folder), through=given.through_blender)
                    print(line, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
