# SPDX-License-Identifier: GPL-3.0-or-later
"""The commands: each hands meshes to a process, waits for it without blocking Blender, and takes the answer back."""

from __future__ import annotations

import json
import shlex
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from . import child, exchange, meshes
from .settings import UnwrapSettings

if TYPE_CHECKING:
    from numpy.typing import NDArray

TICK = 0.1
"""Seconds between two looks at the process."""
OVERLAYS = [(meshes.DISTORTION, "Distortion", "Red is distorted"), (meshes.CHARTS, "Charts", "A colour each")]


class InProcess:
    """What commands share.  `words` says what is run, `take` takes the answer back."""

    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012  # Blender reads a set
    with_uv = True
    chosen: list[meshes.Chosen]
    run: child.Run

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Whether there is a mesh to work on."""
        return bool(meshes.things(context))

    def words(self, folder: Path) -> list[str]:
        """The command line behind the program's name; the mesh lies in the folder as mesh.ply."""
        raise NotImplementedError

    def take(self, folder: Path, said: str) -> None:
        """Bring the answer into Blender."""
        raise NotImplementedError

    def execute(self, context: Any) -> set[str]:
        """Wait for the answer."""
        return self.end(context) if self.begin(context) else {"CANCELLED"}

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Go on in the background; Esc asks for the best so far."""
        del event
        if not self.begin(context):
            return {"CANCELLED"}
        self.timer, self.asked = context.window_manager.event_timer_add(TICK, window=context.window), False
        context.window_manager.progress_begin(0.0, 1.0)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Look at the process now and then."""
        if event.type == "ESC" and event.value == "PRESS":
            (self.run.stop if self.asked else self.run.ask)()
            self.asked = True
        if self.run.running:
            name, share = self.run.stage
            way = "Esc again: stop at once" if self.asked else "Esc: the best so far"
            context.window_manager.progress_update(share)
            context.workspace.status_text_set(f"flexpara: {name} {share:.0%} · {way}")
            return {"RUNNING_MODAL"}
        context.window_manager.event_timer_remove(self.timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)
        return self.end(context)

    def begin(self, context: Any) -> bool:
        """Write the meshes and start the process; whether that was possible."""
        preferences = context.preferences.addons.get(__package__)
        only = bool(getattr(self, "selected_only", False)) and context.mode == "EDIT_MESH"
        found = [meshes.chosen_of(thing, selected_only=only, with_uv=self.with_uv) for thing in meshes.things(context)]
        self.chosen = [entry for entry in found if entry is not None]
        try:
            if not self.chosen:
                raise child.FlexparaError("no faces are selected: select some, or turn Selected Faces off")
            program = child.find(preferences.preferences.program if preferences else "")
            self.folder = tempfile.TemporaryDirectory(prefix="flexpara-")
            folder = Path(self.folder.name)
            exchange.write_ply(exchange.joined([entry.mesh for entry in self.chosen]), folder / "mesh.ply")
            self.run = child.Run(program, self.words(folder))
        except (child.FlexparaError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return False
        return True

    def end(self, context: Any) -> set[str]:
        """Take the answer back, in object mode, and go back to the mode of before: one step for undo."""
        editing = context.mode == "EDIT_MESH"
        try:
            said = self.run.result()
            if editing:
                bpy.ops.object.mode_set(mode="OBJECT")
            self.take(Path(self.folder.name), said)
        except child.FlexparaError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        finally:
            if editing and context.mode != "EDIT_MESH":
                bpy.ops.object.mode_set(mode="EDIT")
            self.folder.cleanup()
        return {"FINISHED"}

    def take_uv(self, path: Path, *, mark_seams: bool) -> None:
        """Write the uv of an answer to all loops worked on, and say what is unlike the mesh."""
        whole = exchange.joined([entry.mesh for entry in self.chosen])
        answer = exchange.read_answer(path, whole)
        parts = zip(
            self.chosen,
            meshes.split(answer.uv, self.chosen, loops=True),
            meshes.split(answer.answered, self.chosen, loops=True),
            strict=True,
        )
        for entry, uv, answered in parts:
            meshes.write_uv(entry, uv, answered, mark_seams=mark_seams)
        if answer.cut:
            self.report({"WARNING"}, f"{answer.cut} polygons had a seam through them and were laid out whole")
        if left := int((~answer.answered).sum()):
            self.report({"WARNING"}, f"{left} corners of faces without area kept their uv")


class FLEXPARA_OT_unwrap(InProcess, UnwrapSettings, bpy.types.Operator):
    """Unwrap the selected meshes into one atlas of few charts with little distortion."""

    bl_idname, bl_label = "flexpara.unwrap", "Unwrap with flexpara"
    with_uv = False

    def words(self, folder: Path) -> list[str]:
        numbers = {"charts": self.charts, "size": self.size, "padding": self.padding, "seed": self.seed}
        if self.max_stretch > 0.0:
            numbers["max-stretch"] = round(self.max_stretch, 4)  # Blender holds float32
        if self.time_budget > 0.0:
            numbers["time-budget"] = self.time_budget
        options = [word for name, value in numbers.items() for word in (f"--{name}", str(value))]
        options += ["--seams", self.seams]
        kept = np.concatenate([meshes.marked_edges(entry) for entry in self.chosen])
        if self.keep_seams and len(kept):
            exchange.write_cuts(kept, folder / "cuts.txt")
            options += ["--cut", str(folder / "cuts.txt")]
        if self.protect:
            np.save(folder / "protected.npy", self.protected())
            options += ["--protect", str(folder / "protected.npy")]
        fixed = ["--format", "npz", "--maps", "none", "--progress-lines"]
        return ["unwrap", str(folder / "mesh.ply"), "-o", str(folder / "out"), *fixed, *options]

    def protected(self) -> NDArray[np.float64]:
        """(n, 3) points of the faces in the vertex group.  Raises: child.FlexparaError where nothing is."""
        part = exchange.joined([meshes.protected_part(entry, self.protect) for entry in self.chosen])
        if not len(part.size):
            raise child.FlexparaError(f"no face lies in the vertex group {self.protect!r}: fill it, or empty Protect")
        return exchange.fan_centres(part)

    def take(self, folder: Path, said: str) -> None:
        del said
        self.take_uv(folder / "out" / "mesh.npz", mark_seams=self.mark_seams)
        numbers = json.loads((folder / "out" / "mesh.report.json").read_text(encoding="utf-8"))["metrics"]
        distortion = 100.0 * (numbers["symmetric_dirichlet_mean"] - 1.0)
        self.report({"INFO"}, f"{numbers['charts']} charts, distortion {distortion:.2f} %")


class FLEXPARA_OT_repack(InProcess, bpy.types.Operator):
    """Pack the islands that the selected meshes have into the unit square."""

    bl_idname, bl_label = "flexpara.repack", "Repack with flexpara"
    size: bpy.props.IntProperty(name="Size", default=2048, min=16, max=16384)
    padding: bpy.props.IntProperty(name="Padding", default=8, min=0)
    density: bpy.props.EnumProperty(
        name="Density",
        items=[
            ("equal", "Equal", "As many texels for each unit of the surface"),
            ("kept", "Kept", "As it is between islands"),
        ],
    )

    def words(self, folder: Path) -> list[str]:
        numbers = ["--size", str(self.size), "--padding", str(self.padding), "--density", self.density]
        fixed = ["--format", "npz", "--maps", "none", "--progress-lines"]
        return ["pack", str(folder / "mesh.ply"), "-o", str(folder / "out"), *fixed, *numbers]

    def take(self, folder: Path, said: str) -> None:
        del said
        self.take_uv(folder / "out" / "mesh.npz", mark_seams=False)


class FLEXPARA_OT_evaluate(InProcess, bpy.types.Operator):
    """Measure the uv of the selected meshes, and show charts and distortion as colours; seams become Blender's."""

    bl_idname, bl_label = "flexpara.evaluate", "Evaluate UV"
    shown: bpy.props.EnumProperty(name="Show", items=OVERLAYS)
    mark_seams: bpy.props.BoolProperty(
        name="Mark Seams", default=True, description="Mark the edges at which the uv part, which edit mode draws"
    )

    def words(self, folder: Path) -> list[str]:
        return ["evaluate", str(folder / "mesh.ply"), "--json", "--faces", str(folder / "faces.npz")]

    def take(self, folder: Path, said: str) -> None:
        with np.load(folder / "faces.npz", allow_pickle=False) as found:
            charts, distortion, polygons = (found[name] for name in ("charts", "distortion", "polygons"))
        count = sum(len(entry.mesh.size) for entry in self.chosen)
        chart, worst = np.zeros(count, np.int64), np.ones(count)
        chart[polygons] = charts
        np.maximum.at(worst, polygons, distortion)
        charts_of, worst_of = (meshes.split(values, self.chosen, loops=False) for values in (chart, worst))
        for entry, own, distorted in zip(self.chosen, charts_of, worst_of, strict=True):
            meshes.show_faces(entry, own, distorted)
            if self.mark_seams:
                meshes.show_seams(entry)
        show(bpy.context, [entry.thing for entry in self.chosen], self.shown)
        bpy.context.scene["flexpara"] = {name: value for name, value in json.loads(said).items() if value is not None}


class FLEXPARA_OT_show(bpy.types.Operator):
    """Show another overlay of what was evaluated last."""

    bl_idname, bl_label, bl_options = "flexpara.show", "Show", {"REGISTER", "UNDO"}
    shown: bpy.props.EnumProperty(name="Show", items=[*OVERLAYS, ("none", "None", "Materials again")])

    def execute(self, context: Any) -> set[str]:
        """At once."""
        show(context, meshes.things(context), self.shown)
        return {"FINISHED"}


def show(context: Any, things: list[Any], shown: str) -> None:
    """One overlay in all 3D views of the screen, or "none"."""
    meshes.show_colors(things, f"{shown} color")
    for area in context.screen.areas if context.screen else ():
        if area.type == "VIEW_3D":
            area.spaces.active.shading.color_type = "MATERIAL" if shown == "none" else "VERTEX"
            area.spaces.active.overlay.show_edge_seams = True


class FLEXPARA_OT_bake(InProcess, bpy.types.Operator):
    """Bake maps of the active mesh onto its uv, from the other selected meshes where there are any."""

    bl_idname, bl_label = "flexpara.bake", "Bake with flexpara"
    maps: bpy.props.StringProperty(name="Maps", default="normal,ao", description="Names with commas between them")
    size: bpy.props.IntProperty(name="Size", default=2048, min=16, max=16384)
    high: bpy.props.BoolProperty(
        name="Selected to Active", default=False, description="From the other selected meshes onto the active one"
    )

    def words(self, folder: Path) -> list[str]:
        options = ["--maps", self.maps, "--size", str(self.size), "--target", "blender", "--progress-lines"]
        if self.high:
            active = bpy.context.view_layer.objects.active
            low = [entry for entry in self.chosen if entry.thing == active]
            others = [entry for entry in self.chosen if entry.thing != active]
            if not low or not others:
                raise child.FlexparaError("selected to active wants an active mesh and others: select them")
            exchange.write_ply(low[0].mesh, folder / "mesh.ply")
            exchange.write_ply(exchange.joined([entry.mesh for entry in others]), folder / "high.ply")
            options += ["--high", str(folder / "high.ply")]
        return ["bake", str(folder / "mesh.ply"), "-o", str(folder / "out"), *options]

    def take(self, folder: Path, said: str) -> None:
        del said
        for path in sorted((folder / "out").iterdir()):
            if path.suffix in (".png", ".exr"):
                image = bpy.data.images.load(str(path))
                image.name = path.stem.replace("mesh", self.chosen[0].thing.name, 1)
                image.pack()
                if not any(word in path.stem.lower() for word in ("color", "emissive")):
                    image.colorspace_settings.name = "Non-Color"


class FLEXPARA_OT_install(bpy.types.Operator):
    """Install flexpara into an environment of its own."""

    bl_idname, bl_label = "flexpara.install", "Install flexpara"

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Show the commands first."""
        del event
        return context.window_manager.invoke_props_dialog(self, width=700)

    def draw(self, context: Any) -> None:
        """What will be run."""
        self.layout.label(text="These commands will be run, which takes minutes and about half a gigabyte:")
        for command in self.commands(context):
            self.layout.label(text=shlex.join(command))

    @staticmethod
    def commands(context: Any) -> list[list[str]]:
        """What makes the environment, from where the preferences say."""
        source = context.preferences.addons[__package__].preferences.source
        return child.install_commands(environment(), sys.executable, source)

    def execute(self, context: Any) -> set[str]:
        """Run them, one after the other."""
        try:
            for command in self.commands(context):
                child.Run(command[0], command[1:]).result()
        except (child.FlexparaError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        context.preferences.addons[__package__].preferences.program = child.installed(environment())
        return {"FINISHED"}


def environment() -> Path:
    """Where the extension may keep an environment."""
    return Path(bpy.utils.extension_path_user(__package__, path="environment", create=True))


COMMANDS = (FLEXPARA_OT_unwrap, FLEXPARA_OT_repack, FLEXPARA_OT_evaluate, FLEXPARA_OT_bake)
"""Those of the menus."""
CLASSES = (*COMMANDS, FLEXPARA_OT_show, FLEXPARA_OT_install)
