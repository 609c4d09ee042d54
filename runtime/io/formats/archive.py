"""Formats that are zip archives: what is checked before anything is unpacked."""

from __future__ import annotations

import io
import zipfile

from ...errors import MeshError
from ..limits import limits, raised


def check_archive(data: bytes) -> None:
    """Raises: MeshError for what is no archive, or unpacks to more than is read."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
    except (zipfile.BadZipFile, NotImplementedError) as error:  # the latter: of a version that there is not yet
        raise MeshError("the file is no zip archive, as its format asks; export it again") from error
    most = limits()
    most.demand_unpacked(size, len(data), "the archive")
    if size > most.bytes:
        raise MeshError(f"the file unpacks to {size} bytes, at most {most.bytes} are read; {raised('bytes')}")
