"""The OpenGL context of the baker: the best device that answers, or an error that says how to mend.

On Linux the context comes from EGL, so neither a display nor a window is needed: every EGL device is tried in turn and
hardware is preferred; Mesa's llvmpipe (a CPU rasterizer) is taken where there is none.  Elsewhere the platform's own
off-screen context is used.  OpenGL 3.3 core is all the shaders ask for.

A context is kept for the next that asks, with its compiled shaders: a device leaks some kilobytes with each context,
and compiling takes longer than most drawings.
"""

from __future__ import annotations

import atexit
import os
import sys
import threading
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ...runtime.errors import FlexparaError, MissingDependencyError

try:
    import moderngl
except ImportError as error:
    raise MissingDependencyError(
        f"moderngl cannot be imported ({error}), baking draws with it: pip install 'flexpara[bake]'"
    ) from error

if TYPE_CHECKING:
    from collections.abc import Iterator

GL_VERSION = 330
SOFTWARE = ("llvmpipe", "softpipe", "swrast", "swiftshader")
MAX_DEVICES = 16
REMEDY = (
    "apt-get install -y libegl1 libgl1 libgl1-mesa-dri"
    " (in an NVIDIA container also NVIDIA_DRIVER_CAPABILITIES=graphics,compute)"
)


@dataclass(frozen=True)
class ContextInfo:
    """What `flexpara doctor` shows.

    renderer, version: the driver's own words.  max_size: largest texture side in texels.  hardware: False for a CPU
    rasterizer.
    """

    renderer: str
    version: str
    max_size: int
    hardware: bool


class Idle(threading.local):
    """Contexts of this thread that nobody uses now: a context belongs to the thread that drew with it last."""

    def __init__(self) -> None:
        self.contexts: list[moderngl.Context] = []


idle = Idle()


def release_idle() -> None:
    """Give back what the contexts of this thread that nobody uses hold."""
    while idle.contexts:
        idle.contexts.pop().release()


atexit.register(release_idle)
if hasattr(os, "register_at_fork"):  # a copied process can't draw with its parent's contexts, nor release them
    os.register_at_fork(after_in_child=lambda: idle.contexts.clear())


@contextmanager
def open_context() -> Iterator[moderngl.Context]:
    """A standalone OpenGL 3.3 context, current while the block runs; a new one where none is idle.

    What is made in it is released by who makes it, but for programs (`shaders`).  It is kept at the end, unless the
    block failed or OpenGL reports an error: then it is released.

    Raises: MissingDependencyError with every attempt's own words and the packages that mend it.
    """
    context, sound = idle.contexts.pop() if idle.contexts else _create(), False
    try:
        with context:
            yield context
            sound = context.error == "GL_NO_ERROR"
    finally:
        if sound:
            idle.contexts.append(context)
        else:
            context.release()


@contextmanager
def drawing_into(context: moderngl.Context, frame: moderngl.Framebuffer) -> Iterator[None]:
    """Bind a framebuffer for the block, then unbind and release it.

    A framebuffer released while bound leaves a name behind that moderngl binds again later: GL_INVALID_OPERATION.
    """
    frame.use()
    try:
        yield
    finally:
        context.detect_framebuffer(0).use()
        frame.release()


def describe() -> ContextInfo:
    """Open a context and say what it is.

    Raises: MissingDependencyError as `open_context`.
    """
    with open_context() as context:
        return ContextInfo(
            renderer=str(context.info["GL_RENDERER"]),
            version=str(context.info["GL_VERSION"]),
            max_size=max_texture_size(context),
            hardware=is_hardware(context),
        )


def max_texture_size(context: moderngl.Context) -> int:
    """Largest side in texels of a texture that can also be drawn into."""
    viewport = context.info["GL_MAX_VIEWPORT_DIMS"]
    return min(int(context.info["GL_MAX_TEXTURE_SIZE"]), *(int(side) for side in viewport))


def check_error(context: moderngl.Context) -> None:
    """Raise FlexparaError when OpenGL has an error to report: what was drawn is then not to be trusted."""
    error = context.error
    if error != "GL_NO_ERROR":
        raise FlexparaError(
            f"OpenGL reports {error}, expected none; bake smaller or fewer maps, or without OpenGL (device software)"
        )


def is_hardware(context: moderngl.Context) -> bool:
    """Whether a GPU draws, judged by the renderer's name."""
    renderer = str(context.info["GL_RENDERER"]).lower()
    return not any(name in renderer for name in SOFTWARE)


def _create() -> moderngl.Context:
    """The first hardware device that answers, else the first software device."""
    software: moderngl.Context | None = None
    failures: list[str] = []
    for label, options in _candidates():
        try:
            context = moderngl.create_context(standalone=True, require=GL_VERSION, **options)
        except Exception as error:  # glcontext and moderngl raise bare Exception; the text is kept
            failures.append(f"{label}: {error}")
            if "but found" in str(error):  # the device list ends here
                break
            continue
        if is_hardware(context):
            if software is not None:
                software.release()
            return context
        if software is None:
            software = context
        else:
            context.release()
    if software is None:
        raise MissingDependencyError(f"no OpenGL 3.3 context could be made ({'; '.join(failures)}): {REMEDY}")
    return software


def _candidates() -> list[tuple[str, dict[str, Any]]]:
    """What to try, in order: EGL devices by index on Linux, the platform's default elsewhere.

    The `.so.1` names are the run-time libraries; without them glcontext looks for the names of development packages.
    """
    if not sys.platform.startswith("linux"):
        return [(sys.platform, {})]
    egl = {"backend": "egl", "libgl": "libGL.so.1", "libegl": "libEGL.so.1"}
    return [(f"EGL device {index}", {**egl, "device_index": index}) for index in range(MAX_DEVICES)]
