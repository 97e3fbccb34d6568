"""The columns of an `.npz` archive, read row by row and written row by row: hours of frames in bounded memory.

`numpy.load` allocates what a header claims before it has seen the bytes; here the claim is held to the archive first.
"""

from __future__ import annotations

import struct
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from arm_ik_service.errors import SessionError

Rows = npt.NDArray[Any]

BLOCK = 4096  # rows a block: a megabyte or two of the widest table
_DATE = (1980, 1, 1, 0, 0, 0)  # the earliest that a zip can say: equal rows give equal bytes
_DAMAGED = (  # what zipfile, zlib and numpy's header reader raise over bytes that are not theirs
    *(zipfile.BadZipFile, zlib.error, struct.error, EOFError, NotImplementedError, RuntimeError, MemoryError),
    *(ValueError, TypeError, KeyError, IndexError, AttributeError, SyntaxError),
)


class Column:
    """One array of the archive: its shape is known at once, its rows come in order."""

    def __init__(self, archive: zipfile.ZipFile, path: Path, name: str) -> None:
        self.name, self._path = name, path
        entry = archive.getinfo(f"{name}.npy")
        with self._explained():
            self._file: IO[bytes] = archive.open(entry)
            version = np.lib.format.read_magic(self._file)
            read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            self.shape, self._by_column, self.dtype = read(self._file)
        if self.dtype.kind not in "biufU" or self.dtype.itemsize == 0:
            raise SessionError(f"{path}: array `{name}` holds {self.dtype}, not numbers")
        self.size = int(np.prod(self.shape, dtype=object))
        if self.size * self.dtype.itemsize > entry.file_size:
            raise SessionError(
                f"{path}: array `{name}` claims the shape {self.shape}, but the archive holds {entry.file_size} bytes "
                "of it; the file is damaged",
                offset=entry.header_offset,
            )
        self._whole: Rows | None = None
        self._at = 0

    def take(self, count: int) -> Rows:
        """Read the next `count` rows."""
        if self._by_column and self._whole is None and len(self.shape) > 1:
            # written with its axes swapped, as `np.array([x, y, z]).T` is: rows lie all over it
            self._whole = self._read(self.shape[0]).reshape(self.shape[::-1]).T
        if self._whole is not None:
            rows = self._whole[self._at : self._at + count]
            self._at += count
            return rows
        return self._read(count).reshape(count, *self.shape[1:])

    def scalar(self) -> Any:
        """Read an array of one element."""
        if self.size != 1:
            raise SessionError(f"{self._path}: array `{self.name}` should be one value but has the shape {self.shape}")
        return self._bytes(self.dtype.itemsize).view(self.dtype)[0].item()

    def close(self) -> None:
        """Let go of the archive."""
        self._file.close()

    def _read(self, count: int) -> Rows:
        width = int(np.prod(self.shape[1:], dtype=object))
        return self._bytes(count * width * self.dtype.itemsize).view(self.dtype)

    def _bytes(self, count: int) -> Rows:
        with self._explained():
            data = self._file.read(count)
        if len(data) < count:
            raise SessionError(f"{self._path}: array `{self.name}` ends early; copy the file again")
        return np.frombuffer(data, np.uint8)

    def _explained(self) -> _Explained:
        return _Explained(f"{self._path}: array `{self.name}` cannot be read")


class _Explained:
    """Turns what zipfile, zlib and numpy raise over damaged bytes into one SessionError."""

    def __init__(self, what: str) -> None:
        self._what = what

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if isinstance(error, (*_DAMAGED, OSError)):
            cause = str(error) or type(error).__name__
            raise SessionError(f"{self._what}: {cause}; the file is damaged, copy it again") from error


class Archive:
    """An `.npz` opened for reading: which columns it has, and readers for them. A context manager."""

    def __init__(self, path: Path) -> None:
        self.path = path
        with _Explained(f"{path}: not a whole .npz archive"):
            self._zip = zipfile.ZipFile(path)
        self.names = tuple(name[:-4] for name in self._zip.namelist() if name.endswith(".npy"))

    def __enter__(self) -> Archive:
        return self

    def __exit__(self, *_: object) -> None:
        self._zip.close()

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def column(self, name: str) -> Column:
        """Open one array. Raises SessionError if it cannot be read or is not of numbers."""
        return Column(self._zip, self.path, name)


class Table:
    """Rows gathered in blocks, then written as one array a field; the file appears whole or not at all."""

    def __init__(self, fields: Sequence[tuple[Any, ...]]) -> None:
        self._dtype = np.dtype(list(fields))
        self._blocks: list[Rows] = []
        self._used = BLOCK

    def __len__(self) -> int:
        return BLOCK * (len(self._blocks) - 1) + self._used if self._blocks else 0

    def append(self, row: tuple[Any, ...]) -> None:
        """Add one row: a tuple in the order of the fields."""
        if self._used == BLOCK:
            self._blocks.append(np.zeros(BLOCK, self._dtype))
            self._used = 0
        self._blocks[-1][self._used] = row
        self._used += 1

    def blocks(self, field: str) -> Iterator[Rows]:
        """Give one field block by block."""
        for index, block in enumerate(self._blocks):
            rows = block[: self._used] if index + 1 == len(self._blocks) else block
            yield rows[field]

    def save(self, path: Path, extra: Mapping[str, Any] | None = None) -> None:
        """Write the table, and single values beside it. Raises SessionError."""
        part = path.with_name(path.name + ".part")
        try:
            with zipfile.ZipFile(part, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
                for name, value in (extra or {}).items():
                    array = np.asarray(value)
                    _write_column(archive, name, array.dtype, array.shape, [array])
                for name in self._dtype.names or ():
                    field = self._dtype[name]
                    _write_column(archive, name, field.base, (len(self), *field.shape), self.blocks(name))
            part.replace(path)
        except OSError as error:
            part.unlink(missing_ok=True)
            raise SessionError(f"{path}: cannot be written: {error.strerror}") from error


def _write_column(
    archive: zipfile.ZipFile, name: str, dtype: np.dtype[Any], shape: tuple[int, ...], blocks: Iterable[Rows]
) -> None:
    entry = zipfile.ZipInfo(f"{name}.npy", _DATE)
    with archive.open(entry, "w", force_zip64=True) as file:
        header = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
        np.lib.format.write_array_header_1_0(file, header)
        for block in blocks:
            file.write(np.ascontiguousarray(block).tobytes())
