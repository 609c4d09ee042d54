"""What all exported maps share: the kind of file, and writing once a proof has passed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from ...runtime.errors import MissingFileError
from ...runtime.files import replace_file
from ...runtime.sessions.bundle import METADATA_KEY
from .builder import Header

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from ...runtime.sessions.bundle import BundleMetadata
    from .builder import Ends, GraphBuilder

Report = TypeVar("Report")

POINT_MAP: tuple[Ends, Ends] = (
    {"points": ("float32", ["n", 3])},
    {"uv": ("float32", ["n", 2]), "chart": ("int64", ["n"]), "score": ("float32", ["n"])},
)
"""Inputs and outputs of a map from surface points to the atlas."""


@dataclass(frozen=True)
class FileKind:
    """Which onnxruntime can read a file."""

    opset: int = 18
    """Operator set of the default domain."""
    ir_version: int = 8
    """ONNX IR version that goes with opset 18: loads in onnxruntime 1.14 and later."""

    def serialize(
        self, builder: GraphBuilder, inputs: Ends, outputs: Ends, metadata: BundleMetadata, text: str, name: str
    ) -> bytes:
        """The finished model.

        Args:
            builder: its nodes.
            inputs: see builder.Ends.
            outputs: likewise.
            metadata: names the producer.
            text: the JSON attached to the file.
            name: of the graph.
        """
        producer = metadata.producer_name, metadata.producer_version
        header = Header(self.opset, self.ir_version, producer, {METADATA_KEY: text}, name)
        return builder.serialize(inputs, outputs, header)


def check_folder(path: Path) -> None:
    """Raises: MissingFileError where the folder that ``path`` is to be written to is absent."""
    if not path.parent.is_dir():
        raise MissingFileError(f"{path.parent}: no such folder, expected one to write {path.name} to; create it first")


def write_proven(path: Path, content: bytes, prove: Callable[[bytes], Report]) -> Report:
    """Write the file once ``prove`` has passed on its content; returns what it found.

    What the proof raises leaves nothing behind.  The file appears whole or not at all.
    """
    report = prove(content)
    replace_file(path, content)
    return report
