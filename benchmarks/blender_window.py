"""Pictures of the extension in Blender's window: `blender --enable-event-simulate --python SCRIPT -- PROGRAM MESH OUT`.

SCRIPT is this file.  It runs inside the full program, on a display of 1600 × 1000 (Xvfb will do, drawn in software);
PROGRAM is flexpara.  MESH, an OBJ file, is unwrapped and evaluated by the extension's own commands, and OUT receives
`blender-sidebar.png` and `blender-heat.png`.  Blender before 3.5 has another name for the uv of loops, which is put
right here and nowhere else: the extension is for 4.2.
"""

from __future__ import annotations

import importlib
import sys
from functools import partial
from pathlib import Path
from typing import Any

bpy: Any = importlib.import_module("bpy")  # the checkers of types have none
EXTENSION = Path(__file__).resolve().parents[1] / "integrations" / "blender"
TAB_BELOW = 173
"""Pixels from the top of a sidebar to the middle of its fourth tab."""
ROOM = 1.4
"""Times what fills the view that the view shows, so that the sidebar covers none of it."""
WAIT = 1.0
"""Seconds between two steps, in which Blender draws."""


class Rows:
    """The uv of a layer of Blender before 3.5, under the name that it has since."""

    def __init__(self, data: Any) -> None:
        self.data = data

    def __len__(self) -> int:
        return len(self.data)

    def foreach_get(self, _name: str, values: Any) -> None:
        """Read them."""
        self.data.foreach_get("uv", values)

    def foreach_set(self, values: Any) -> None:
        """Write them."""
        self.data.foreach_set("uv", values.reshape(-1))


def enabled(program: str) -> None:
    """The extension, which finds this program."""
    sys.path.insert(0, str(EXTENSION.parent))
    if bpy.app.version < (3, 5, 0):
        bpy.types.MeshUVLoopLayer.uv = property(lambda layer: Rows(layer.data))
    extension = importlib.import_module(EXTENSION.name)
    if bpy.app.version < (3, 5, 0):
        extension.meshes.set_uv = lambda data, name, values: Rows(data.uv_layers[name].data).foreach_set(values)
    for panel in (extension.interface.FLEXPARA_PT_image, extension.interface.FLEXPARA_PT_view):
        panel.bl_order = 0
    extension.register()
    extension.child.find = lambda preferred="": program or preferred


def arranged(mesh: str) -> None:
    """The mesh alone, in edit mode, in the workspace for uv, with both sidebars open."""
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    bpy.ops.wm.obj_import(filepath=mesh)
    bpy.context.window.workspace = bpy.data.workspaces["UV Editing"]


def opened() -> None:
    """Sidebars at our tab, the mesh in the middle of the view."""
    bpy.context.view_layer.objects.active = bpy.context.selected_objects[0]
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    for area in bpy.context.screen.areas:
        if area.type in ("IMAGE_EDITOR", "VIEW_3D"):
            area.spaces.active.show_region_ui = True
    framed()


def framed() -> None:
    """What is selected fills both views."""
    ways = {"VIEW_3D": lambda: bpy.ops.view3d.view_selected(), "IMAGE_EDITOR": lambda: bpy.ops.image.view_all()}
    for area in bpy.context.screen.areas:
        if area.type in ways:
            region = next(region for region in area.regions if region.type == "WINDOW")
            with bpy.context.temp_override(area=area, region=region):
                ways[area.type]()
        if area.type == "VIEW_3D":
            area.spaces.active.region_3d.view_distance *= ROOM


def tab_chosen(kind: str, value: str) -> None:
    """A click on our tab in a sidebar, which no property chooses before Blender 4.2; value: PRESS or RELEASE."""
    area = next(area for area in bpy.context.screen.areas if area.type == kind)
    region = next(region for region in area.regions if region.type == "UI")
    place = {"x": region.x + region.width - 10, "y": region.y + region.height - TAB_BELOW}
    bpy.context.window.event_simulate(type="MOUSEMOVE", value="NOTHING", **place)
    bpy.context.window.event_simulate(type="LEFTMOUSE", value=value, **place)


def shot(path: Path) -> None:
    """The whole window as a picture."""
    bpy.ops.screen.screenshot(filepath=str(path))


def main(program: str, mesh: str, out: str) -> None:
    """One step after the other; Blender draws between them."""
    steps = [
        lambda: enabled(program),
        lambda: arranged(mesh),
        lambda: bpy.ops.object.mode_set(mode="OBJECT"),
        lambda: bpy.ops.flexpara.unwrap(charts=8, size=1024),
        lambda: bpy.ops.flexpara.evaluate(shown="flexpara charts"),
        opened,
        framed,
        *(partial(tab_chosen, kind, value) for kind in ("IMAGE_EDITOR", "VIEW_3D") for value in ("PRESS", "RELEASE")),
        lambda: shot(Path(out) / "blender-sidebar.png"),
        lambda: (bpy.ops.object.mode_set(mode="OBJECT"), bpy.ops.flexpara.show(shown="flexpara distortion")),
        lambda: shot(Path(out) / "blender-heat.png"),
        bpy.ops.wm.quit_blender,
    ]

    def step() -> float | None:
        steps.pop(0)()
        return WAIT if steps else None

    bpy.app.timers.register(step, first_interval=WAIT)


if __name__ == "__main__":
    main(*sys.argv[sys.argv.index("--") + 1 :])
