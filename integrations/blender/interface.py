# SPDX-License-Identifier: GPL-3.0-or-later
"""What one sees: the preferences, a tab in the sidebars of the UV editor and the 3D view, entries in their UV menus."""

from __future__ import annotations

from typing import Any

import bpy

from . import child, operators, settings

SHOWN = {
    "charts": "Charts",
    "symmetric_dirichlet_mean": "Distortion (1 is none)",
    "seam_length": "Seam length",
    "flipped_faces": "Flipped triangles",
    "overlap_fraction": "Overlap",
    "packing_efficiency": "Use of the square",
}


class FlexparaPreferences(bpy.types.AddonPreferences):
    """Where flexpara is."""

    bl_idname = __package__
    program: bpy.props.StringProperty(
        name="Program", subtype="FILE_PATH", description="The flexpara program; empty: the one on PATH"
    )
    source: bpy.props.StringProperty(
        name="Install from", subtype="FILE_PATH", description="A checkout or wheel of flexpara, or an address for pip"
    )

    def draw(self, context: Any) -> None:
        """The path, what is found, and the button that installs it."""
        del context
        self.layout.prop(self, "program")
        try:
            self.layout.label(text=f"Found: {child.find(self.program)}", icon="CHECKMARK")
        except child.FlexparaError as error:
            self.layout.label(text=str(error), icon="ERROR")
        self.layout.prop(self, "source")
        row = self.layout.row()
        row.enabled = bool(self.source)
        row.operator(operators.FLEXPARA_OT_install.bl_idname)


class Sidebar:
    """The tab of both sidebars."""

    bl_region_type, bl_category, bl_label = "UI", "flexpara", "flexpara"

    def draw(self, context: Any) -> None:
        """What can be asked, the commands, and what was measured last."""
        asked = settings.settings_of(context)
        column = self.layout.column()
        column.use_property_split, column.use_property_decorate = True, False
        for name in settings.NAMES:
            if name == "protect" and context.object is not None:
                column.prop_search(asked, name, context.object, "vertex_groups")
            else:
                column.prop(asked, name)
        for entry in operators.COMMANDS:
            settings.handed_over(asked, self.layout.operator(entry.bl_idname))
        measured = context.scene.get("flexpara")
        if measured is None:
            return
        row = self.layout.row(align=True)
        for shown, label, _ in (*operators.OVERLAYS, ("none", "None", "")):
            row.operator(operators.FLEXPARA_OT_show.bl_idname, text=label).shown = shown
        for key, label in SHOWN.items():
            if key in measured:
                self.layout.label(text=f"{label}: {measured[key]:.4g}")


class FLEXPARA_PT_image(Sidebar, bpy.types.Panel):
    """In the UV editor."""

    bl_space_type = "IMAGE_EDITOR"


class FLEXPARA_PT_view(Sidebar, bpy.types.Panel):
    """In the 3D view."""

    bl_space_type = "VIEW_3D"


def draw_menu(menu: Any, context: Any) -> None:
    """The commands in a UV menu."""
    del context
    menu.layout.separator()
    for entry in operators.COMMANDS:
        menu.layout.operator(entry.bl_idname)


def add_menus() -> None:
    """Put the commands into the UV menus of the UV editor and of the 3D view's edit mode."""
    bpy.types.IMAGE_MT_uvs.append(draw_menu)
    bpy.types.VIEW3D_MT_uv_map.append(draw_menu)


def remove_menus() -> None:
    """Take them out again."""
    bpy.types.IMAGE_MT_uvs.remove(draw_menu)
    bpy.types.VIEW3D_MT_uv_map.remove(draw_menu)


CLASSES = (FlexparaPreferences, FLEXPARA_PT_image, FLEXPARA_PT_view)
