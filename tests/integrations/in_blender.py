"""What the extension does inside Blender, as a script: `PYTHON in_blender.py FOLDER_OF_EXTENSION FLEXPARA`.

Needs numpy and bpy and nothing of ours; prints a line of JSON, or ends with the assertion that failed.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

bpy: Any = importlib.import_module("bpy")  # the checkers of types have none
things: Any = importlib.import_module("blender_things")  # beside this script
window: Any = importlib.import_module("blender_window")


def cube() -> None:
    things.empty()
    bpy.ops.mesh.primitive_cube_add()
    thing = bpy.context.object
    assert bpy.ops.flexpara.unwrap(size=256, padding=2) == {"FINISHED"}
    space, flat = things.areas(thing)
    np.testing.assert_allclose(flat / space, (flat / space).mean(), rtol=1e-4)
    assert flat.min() > 0.0
    assert things.uv_of(thing).min() >= 0.0
    assert things.uv_of(thing).max() <= 1.0
    assert things.seams_are_where_uv_part(thing)
    assert [len(face.vertices) for face in thing.data.polygons] == [4] * 6


def suzanne() -> dict[str, float]:
    """With an n-gon; beside Blender's own ways."""
    things.empty()
    bpy.ops.mesh.primitive_monkey_add()
    thing = bpy.context.object
    thing.data.uv_layers.remove(thing.data.uv_layers.active)
    things.select_faces(thing, 0, 2, 4, 6)
    bpy.ops.mesh.dissolve_faces()
    start = time.perf_counter()
    assert bpy.ops.flexpara.unwrap(size=512) == {"FINISHED"}
    seconds = {"flexpara": time.perf_counter() - start}
    assert bpy.context.mode == "EDIT_MESH"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert max(len(face.vertices) for face in thing.data.polygons) > 4
    assert things.seams_are_where_uv_part(thing)
    assert things.same_density(thing)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    seconds |= peers()
    bpy.ops.object.mode_set(mode="OBJECT")
    return seconds


def peers() -> dict[str, float]:
    """Seconds of Blender's own commands on what is edited; minimum stretch along the seams that are there."""
    ways = {"smart_project": lambda: bpy.ops.uv.smart_project()}
    if bpy.app.version >= (4, 3, 0):
        ways["minimum_stretch"] = lambda: bpy.ops.uv.unwrap(method="MINIMUM_STRETCH")
    seconds = {}
    for name, way in ways.items():
        start = time.perf_counter()
        assert way() == {"FINISHED"}
        seconds[name] = time.perf_counter() - start
    return seconds


def modifiers() -> None:
    """The base mesh is unwrapped; what modifiers make of it has uv, too."""
    things.empty()
    bpy.ops.mesh.primitive_cylinder_add(vertices=12)
    thing = bpy.context.object
    thing.modifiers.new("smooth", "SUBSURF")
    thing.modifiers.new("twice", "ARRAY")
    assert bpy.ops.flexpara.unwrap(size=256, padding=2) == {"FINISHED"}
    assert sorted({len(face.vertices) for face in thing.data.polygons}) == [4, 12]
    assert things.seams_are_where_uv_part(thing)
    assert things.same_density(thing)
    evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    assert len(evaluated.polygons) > 2 * len(thing.data.polygons)
    assert evaluated.uv_layers.active is not None


def several() -> None:
    """Two objects of other scales share one atlas, at one density in the world; a third is left alone."""
    things.empty()
    bpy.ops.mesh.primitive_cube_add(location=(4, 0, 0))
    alone = bpy.context.object
    before = things.uv_of(alone)
    bpy.ops.mesh.primitive_cube_add()
    first = bpy.context.object
    bpy.ops.mesh.primitive_cube_add(size=2, scale=(3, 3, 3))
    second = bpy.context.object
    things.picked(first, second)
    assert bpy.ops.flexpara.unwrap(size=512, padding=2) == {"FINISHED"}
    assert things.same_density(first, second)
    np.testing.assert_array_equal(things.uv_of(alone), before)
    everything = np.concatenate([things.uv_of(first), things.uv_of(second)])
    assert everything.min() >= 0.0
    assert everything.max() <= 1.0
    assert bpy.ops.flexpara.repack(size=256, padding=1) == {"FINISHED"}
    assert things.same_density(first, second)


def selected_faces() -> None:
    """Other faces keep their uv."""
    things.empty()
    bpy.ops.mesh.primitive_cube_add()
    thing = bpy.context.object
    before = things.uv_of(thing)
    things.select_faces(thing, 1, 2)
    assert bpy.ops.flexpara.unwrap(size=256, padding=2, selected_only=True) == {"FINISHED"}
    bpy.ops.object.mode_set(mode="OBJECT")
    changed = (np.abs(things.uv_of(thing) - before).max(axis=1) > 0.0).reshape(6, 4).any(axis=1)
    assert changed.tolist() == [False, True, True, False, False, False]


def kept_seams() -> None:
    """A ring marked around a torus, where no seam would pay, stays one."""
    things.empty()
    bpy.ops.mesh.primitive_torus_add(major_segments=24, minor_segments=12)
    thing = bpy.context.object
    corners = np.array([vertex.co for vertex in thing.data.vertices])
    ring = np.flatnonzero((np.abs(corners[:, 1]) < 1e-5) & (corners[:, 0] > 0.0))
    marked = [edge.index for edge in thing.data.edges if set(edge.vertices) <= set(ring.tolist())]
    assert len(marked) == 12
    for edge in marked:
        thing.data.edges[edge].use_seam = True
    assert bpy.ops.flexpara.unwrap(size=256, padding=2, keep_seams=True) == {"FINISHED"}
    assert all(thing.data.edges[edge].use_seam for edge in marked)
    assert things.seams_are_where_uv_part(thing)


def protected_faces() -> None:
    """Suzanne's face has shorter seams once it is in a vertex group; a group without faces is refused."""
    things.empty()
    bpy.ops.mesh.primitive_monkey_add()
    thing = bpy.context.object
    corners = np.array([vertex.co for vertex in thing.data.vertices])
    front = np.flatnonzero(corners[:, 1] < np.quantile(corners[:, 1], 0.3))
    thing.vertex_groups.new(name="face").add(front.tolist(), 1.0, "REPLACE")

    def seams_inside() -> float:
        ends = np.array([list(thing.data.edges[edge].vertices) for edge in things.seams_of(thing)])
        inside = corners[ends[np.isin(ends, front).all(axis=1)]]
        return float(np.linalg.norm(inside[:, 1] - inside[:, 0], axis=1).sum())

    found = []
    for group in ("", "face"):
        assert bpy.ops.flexpara.unwrap(size=256, padding=2, protect=group) == {"FINISHED"}
        found.append(seams_inside())
    assert found[1] < 0.8 * found[0], found
    said = things.refused(lambda: bpy.ops.flexpara.unwrap(size=256, padding=2, protect="nose"))
    assert "no face lies in the vertex group 'nose'" in said


def undo() -> None:
    """One step takes back uv and seams, of an object and of what is edited; so for repacking."""
    things.empty()
    bpy.ops.mesh.primitive_cube_add()
    thing = bpy.context.object
    name, before = thing.name, things.uv_of(thing)
    bpy.ops.ed.undo_push(message="before")
    assert bpy.ops.flexpara.unwrap("EXEC_DEFAULT", True, size=256, padding=2) == {"FINISHED"}
    after = things.uv_of(thing)
    assert bpy.ops.flexpara.repack("EXEC_DEFAULT", True, size=256, padding=30) == {"FINISHED"}
    assert np.abs(things.uv_of(thing) - after).max() > 0.01
    thing = things.undone(name)
    np.testing.assert_array_equal(things.uv_of(thing), after)
    assert things.seams_of(thing)
    thing = things.undone(name)
    np.testing.assert_array_equal(things.uv_of(thing), before)
    assert not things.seams_of(thing)
    things.select_faces(thing, 1, 2)
    bpy.ops.ed.undo_push(message="edited")
    assert bpy.ops.flexpara.unwrap("EXEC_DEFAULT", True, size=256, padding=2, selected_only=True) == {"FINISHED"}
    thing = things.undone(name)
    assert bpy.context.mode == "EDIT_MESH"
    bpy.ops.object.mode_set(mode="OBJECT")
    np.testing.assert_array_equal(things.uv_of(thing), before)


def several_edited() -> None:
    """Selected faces of two objects in edit mode share the square; what is not selected stays."""
    things.empty()
    made = []
    for place in (0.0, 4.0):
        bpy.ops.mesh.primitive_cube_add(location=(place, 0, 0))
        made.append(bpy.context.object)
    before = things.uv_of(made[0])
    things.picked(*made)
    things.select_faces(made[1], 1, 2)
    bpy.ops.object.mode_set(mode="OBJECT")
    for thing in made:
        for face in thing.data.polygons:
            face.select = face.index in (1, 2)
    bpy.ops.object.mode_set(mode="EDIT")
    assert bpy.ops.flexpara.unwrap(size=256, padding=2, selected_only=True) == {"FINISHED"}
    assert bpy.context.mode == "EDIT_MESH"
    bpy.ops.object.mode_set(mode="OBJECT")
    new = [things.uv_of(thing).reshape(6, 4, 2)[1:3] for thing in made]
    for thing in made:
        np.testing.assert_array_equal(things.uv_of(thing)[12:], before[12:])
    centres = np.concatenate(new).mean(axis=1)
    assert min(np.linalg.norm(centres[i] - centres[j]) for i in range(4) for j in range(i)) > 0.1


def evaluate_and_bake() -> None:
    """Charts and distortion become attributes, numbers are kept, maps become packed pictures."""
    things.empty()
    bpy.ops.mesh.primitive_cube_add()
    thing = bpy.context.object
    assert bpy.ops.flexpara.evaluate() == {"FINISHED"}
    assert bpy.context.scene["flexpara"]["charts"] == 1
    attribute = thing.data.attributes["flexpara distortion"]
    assert abs(max(entry.value for entry in attribute.data) - 1.0) < 1e-5
    assert thing.data.color_attributes.active_color.name == "flexpara distortion color"
    assert bpy.ops.flexpara.show(shown="flexpara charts") == {"FINISHED"}
    assert thing.data.color_attributes.active_color.name == "flexpara charts color"
    assert bpy.ops.flexpara.bake(maps="normal,uv-checker", size=64) == {"FINISHED"}
    assert len([image for image in bpy.data.images if image.packed_file and image.size[0] == 64]) == 2


def overlays() -> None:
    """Two charts of a cube, one of them stretched: colours, numbers and seams say which."""
    things.empty()
    bpy.ops.mesh.primitive_cube_add()
    thing = bpy.context.object
    layer, top = thing.data.uv_layers.active, max(thing.data.polygons, key=lambda face: face.center.z).index
    for face in thing.data.polygons:
        for corner, loop in enumerate(face.loop_indices):
            square = ((0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1))[corner]
            wide = 4.0 if face.index == top else 1.0
            layer.uv[loop].vector = (square[0] * wide + 0.5 * (face.index % 2), square[1] + 0.2 * (face.index // 2))
    assert bpy.ops.flexpara.evaluate(shown="flexpara charts") == {"FINISHED"}
    assert len({entry.value for entry in thing.data.attributes["flexpara charts"].data}) == 6
    worst = [entry.value for entry in thing.data.attributes["flexpara distortion"].data]
    assert max(range(6), key=worst.__getitem__) == top
    assert [entry.value for entry in thing.data.attributes["flexpara seams"].data] == [True] * 12
    assert all(edge.use_seam for edge in thing.data.edges)
    heat = thing.data.color_attributes["flexpara distortion color"].data
    red = [heat[loop].color_srgb[0] - heat[loop].color_srgb[1] for loop in range(24)]
    on_top = [loop // 4 == top for loop in range(24)]
    assert min(np.compress(on_top, red)) > max(np.compress(np.logical_not(on_top), red))
    charts = thing.data.color_attributes["flexpara charts color"].data
    assert len({tuple(np.round(charts[loop].color_srgb, 2)) for loop in range(24)}) == 6


def sidebar(extension: Any) -> list[str]:
    """What is drawn: fields and buttons that stand for the settings of the scene and the commands."""
    bpy.context.scene.flexpara_settings.charts = 3
    layout = window.Layout()
    type("Panel", (extension.interface.Sidebar,), {"layout": layout})().draw(bpy.context)
    lines, asked = layout.lines, layout.asked
    assert "Charts: 3" in lines
    assert "Seams: short" in lines
    assert "[Unwrap with flexpara]" in lines
    assert asked[0].charts == 3
    assert any(line.startswith("Seam length: ") for line in lines), lines
    return lines


def in_background(operators: Any) -> None:
    """A bar follows the stages; Esc once asks for the best so far, which is taken over."""
    things.empty()
    bpy.ops.mesh.primitive_torus_add(major_segments=96, minor_segments=48)
    things.picked(bpy.context.object)
    kind = operators.FLEXPARA_OT_unwrap
    settings = {"charts": 8, "max_stretch": 0.0, "time_budget": 0.0, "size": 256, "padding": 2, "seed": 0}
    settings |= {"selected_only": False, "keep_seams": False, "seams": "short", "protect": ""}
    settings |= {"mark_seams": True}
    methods = {name: getattr(kind, name) for name in ("words", "take", "with_uv")}
    told: list[Any] = []
    command, shown = type("Unwrap", (operators.InProcess,), methods | settings)(), window.Window()
    command.report = lambda *words: told.append(words)
    assert command.invoke(shown, window.Event("MOUSEMOVE")) == {"RUNNING_MODAL"}
    escaped = False
    while (state := command.modal(shown, window.Event("TIMER"))) == {"RUNNING_MODAL"}:
        if not escaped and command.run.stage.name == "charts":
            command.modal(shown, window.Event("ESC", "PRESS"))
            escaped = True
        time.sleep(0.02)
    assert (state, escaped) == ({"FINISHED"}, True), told
    assert any("Esc again: stop at once" in str(text) for text in shown.said)
    assert shown.said[-3:] == ["timer of None", "bar gone", None]
    assert len(set(shown.shares)) > 2
    assert shown.shares[1:] == sorted(shown.shares[1:])
    assert told[-1][0] == {"INFO"}
    assert np.ptp(things.uv_of(bpy.context.object), axis=0).min() > 0.3


def failures() -> None:
    """What flexpara complains of is Blender's error, and nothing is changed."""
    things.empty()
    bpy.ops.mesh.primitive_cube_add()
    thing = bpy.context.object
    before = things.uv_of(thing)
    assert "padding is 8 texels" in things.refused(lambda: bpy.ops.flexpara.unwrap(size=16, padding=8))
    np.testing.assert_array_equal(things.uv_of(thing), before)


def main(folder: str, program: str) -> None:
    """All checks."""
    extension = things.enabled(Path(folder), program)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    cube()
    seconds = suzanne()
    for check in (modifiers, several, several_edited, selected_faces, kept_seams, protected_faces, undo):
        check()
    evaluate_and_bake()
    overlays()
    lines = sidebar(extension)
    in_background(extension.operators)
    failures()
    extension.unregister()
    assert not hasattr(bpy.types, "FLEXPARA_OT_unwrap")
    sys.stdout.write(json.dumps({"blender": bpy.app.version_string, "seconds": seconds, "sidebar": lines}) + "\n")
    sys.stdout.flush()
    os._exit(0)  # bpy 4.2 may crash while it is taken down


if __name__ == "__main__":
    main(*sys.argv[1:])
