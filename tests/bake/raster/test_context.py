"""The context is the best there is, and its absence is explained."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import Any

import moderngl
import pytest

from flexpara.bake.raster import context as module
from flexpara.bake.raster.shaders import build_program
from flexpara.runtime.errors import FlexparaError, MissingDependencyError


class FakeContext:
    """As much of a context as choosing needs."""

    def __init__(self, renderer: str) -> None:
        self.info = {"GL_RENDERER": renderer}
        self.released, self.error = False, "GL_NO_ERROR"

    def __enter__(self) -> None: ...

    def __exit__(self, *_: object) -> None: ...

    def release(self) -> None:
        self.released = True


@pytest.fixture(autouse=True)
def none_idle() -> Iterator[None]:
    """Before and after."""
    module.release_idle()
    yield
    module.release_idle()


def devices(monkeypatch: pytest.MonkeyPatch, answers: list[FakeContext | str]) -> None:
    """Let EGL device i answer with answers[i]: a context, or the text of an error."""

    def create_context(**options: Any) -> FakeContext:
        index = options["device_index"]
        if index >= len(answers):
            raise Exception(f"requested device index {index}, but found {len(answers)} devices")
        answer = answers[index]
        if isinstance(answer, str):
            raise Exception(answer)
        return answer

    monkeypatch.setattr(module.moderngl, "create_context", create_context)
    monkeypatch.setattr(module.sys, "platform", "linux")


def test_a_context_can_be_opened_and_described() -> None:
    info = module.describe()
    assert info.renderer
    assert info.version
    assert info.max_size >= 1024


def test_hardware_is_preferred_to_an_earlier_software_device(monkeypatch: pytest.MonkeyPatch) -> None:
    software, hardware = FakeContext("llvmpipe (LLVM 15)"), FakeContext("NVIDIA H100")
    devices(monkeypatch, [software, "eglInitialize failed (0x3001)", hardware])
    with module.open_context() as context:
        assert context is hardware
    assert software.released
    assert not hardware.released


def test_the_first_of_several_software_devices_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = FakeContext("llvmpipe"), FakeContext("softpipe")
    devices(monkeypatch, [first, second])
    with module.open_context() as context:
        assert context is first
        assert not first.released
    assert second.released


def test_no_device_is_explained_with_every_attempt_and_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    devices(monkeypatch, ["libEGL.so.1 not loaded", "eglInitialize failed (0x3001)"])
    with pytest.raises(MissingDependencyError) as caught, module.open_context():
        pass
    message = str(caught.value)
    assert "EGL device 0: libEGL.so.1 not loaded" in message
    assert "EGL device 1: eglInitialize failed" in message
    assert "found 2 devices" in message
    assert "apt-get install -y libegl1" in message
    assert "\n" not in message


def test_a_context_is_kept_for_the_next_that_asks_with_its_programs() -> None:
    with module.open_context() as context:
        program = build_program(context, ("blank.vert",), ("blank.frag",))
        with module.open_context() as other:
            assert other is not context
    for _ in range(2):
        with module.open_context() as again:
            assert again is context
            assert build_program(again, ("blank.vert",), ("blank.frag",)) is program
            again.texture((4, 4), 4).release()
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(lambda: module.idle.contexts).result() == []


def test_a_context_with_an_error_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = FakeContext("llvmpipe"), FakeContext("llvmpipe")
    devices(monkeypatch, [first])
    with module.open_context():
        first.error = "GL_OUT_OF_MEMORY"
    assert first.released
    devices(monkeypatch, [second])
    with module.open_context() as context:
        assert context is second


def test_a_context_is_released_when_its_block_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    only = FakeContext("llvmpipe")
    devices(monkeypatch, [only])
    with pytest.raises(KeyboardInterrupt), module.open_context():
        raise KeyboardInterrupt
    assert only.released


def test_a_leak_would_be_seen(leaks: Callable[[moderngl.Context], list[str]]) -> None:
    with module.open_context() as context:
        context.gc_mode = "context_gc"
        context.texture((4, 4), 4).release()
        assert leaks(context) == []
        texture = context.texture((4, 4), 4)
        del texture
        assert leaks(context) == ["Texture"]
        context.objects.pop().release()


def test_an_error_of_opengl_is_not_passed_over(context: moderngl.Context) -> None:
    module.check_error(context)
    failing: Any = SimpleNamespace(error="GL_OUT_OF_MEMORY")
    with pytest.raises(FlexparaError, match=r"GL_OUT_OF_MEMORY, expected none; .*device software"):
        module.check_error(failing)


def test_drawing_again_after_a_release_is_no_error(context: moderngl.Context) -> None:
    for _ in range(2):
        texture = context.texture((4, 4), 4)
        frame = context.framebuffer([texture])
        with module.drawing_into(context, frame):
            frame.clear()
        texture.release()
        assert context.error == "GL_NO_ERROR"
