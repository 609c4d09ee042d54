# SPDX-License-Identifier: GPL-3.0-or-later
"""flexpara in Blender: unwrap, repack, evaluate and bake from the UV menu, the work done by a process beside Blender.

`exchange` (arrays and files) and `child` (the process) know nothing of Blender; `meshes` reads and writes its data,
`settings` is what can be asked, `operators` are the commands, `interface` is what one sees of them.
"""

from . import interface, operators, settings

CLASSES = (*settings.CLASSES, *operators.CLASSES, *interface.CLASSES)


def register() -> None:
    """Called by Blender when the extension is enabled."""
    import bpy

    for entry in CLASSES:
        bpy.utils.register_class(entry)
    settings.add()
    interface.add_menus()


def unregister() -> None:
    """Called by Blender when the extension is disabled."""
    import bpy

    interface.remove_menus()
    settings.remove()
    for entry in reversed(CLASSES):
        bpy.utils.unregister_class(entry)
