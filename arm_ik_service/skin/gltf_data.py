"""The numbers of a glTF file: accessors, buffer views, buffers, and the files that these lie in."""

from __future__ import annotations

import base64
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt

from arm_ik_service.errors import SkinError

Array = npt.NDArray[Any]

COMPONENTS: dict[int, str] = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def widened(values: Array, width: int) -> Array:
    """Pad columns of zeros to (N, width)."""
    return np.pad(values, ((0, 0), (0, width - values.shape[1])))


@dataclass
class GltfData:
    """What the indices of `document` stand for; `folder` is the file's."""

    document: Any
    folder: Path
    buffers: dict[int, bytes] = field(default_factory=dict)

    def accessor(self, index: int) -> Array:
        """Return an accessor as (count, width); normalised integers as their fractions."""
        accessor = self.document.accessors[index]
        dtype = np.dtype("<" + COMPONENTS[accessor.componentType])
        width, count = WIDTHS[accessor.type], accessor.count
        if accessor.bufferView is None:
            values = np.zeros((count, width), dtype)
        else:
            values = self.view(accessor.bufferView, accessor.byteOffset or 0, dtype, count, width)
        if accessor.sparse is not None:
            places, changes = accessor.sparse.indices, accessor.sparse.values
            kind = np.dtype("<" + COMPONENTS[places.componentType])
            changed = accessor.sparse.count
            at = self.view(places.bufferView, places.byteOffset or 0, kind, changed, 1)[:, 0]
            values = values.copy()
            values[at] = self.view(changes.bufferView, changes.byteOffset or 0, dtype, changed, width)
        if accessor.normalized:
            values = np.maximum(values / np.iinfo(dtype).max, -1.0)
        return values

    def view(self, index: int, offset: int, dtype: np.dtype[Any], count: int, width: int) -> Array:
        """Return `count` rows of `width` numbers that begin `offset` bytes into a buffer view."""
        view = self.document.bufferViews[index]
        row = dtype.itemsize * width
        stride = view.byteStride or row
        start = (view.byteOffset or 0) + offset
        raw = self._buffer(view.buffer)
        if count and start + (count - 1) * stride + row > len(raw):
            raise SkinError(
                f"the file ends early: {len(raw)} bytes where {start + (count - 1) * stride + row} are needed"
            )
        return np.ndarray((count, width), dtype, raw, start, (stride, dtype.itemsize))

    def _buffer(self, index: int) -> bytes:
        if index not in self.buffers:
            uri = self.document.buffers[index].uri
            self.buffers[index] = (self.document.binary_blob() or b"") if uri is None else self.file(uri)
        return self.buffers[index]

    def file(self, uri: str) -> bytes:
        """Return what an URI holds: data in itself, or the name of a file beside this one."""
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition(",")[2])
        beside = self.folder / unquote(uri)
        try:
            return beside.read_bytes()
        except OSError as error:
            raise SkinError(f"its data file {beside}: {error.strerror}") from error
