"""Sessions as `.npz`: `t` (N,) [s], and `head`, `left`, `right` (N,7) x y z qx qy qz qw in OpenXR axes, metres.

Read where present: `{head,left,right}_valid` (N,), false where the device is absent, and `meta`, a JSON text. What
`arm-ik convert` writes has more, so that nothing is lost on the way: `sample_time_ns, receive_time_ns, seq` and
`publish_time_ns` (N,), `space` and `avatar`, and for each device `_flags` (N,) and `_linear_velocity`,
`_angular_velocity` (N,3), where not-a-number means that there is none. Other arrays are ignored.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, get_args

import msgspec
import numpy as np

from arm_ik_service.errors import SessionError, WireError
from arm_ik_service.io.columns import BLOCK, Archive, Column, Table
from arm_ik_service.io.samples import clean_poses, to_nanoseconds, to_tracked_poses
from arm_ik_service.io.session import DEFAULT_AVATAR, RecordedFrame, RecordedProfile
from arm_ik_service.wire.keys import check_id
from arm_ik_service.wire.messages import VERSION, ArmsState, ControllerFrame, Space, TrackedPose, Vector

DEVICES = ("head", "left", "right")
_WIDTH = {"_flags": (), "_valid": (), "_linear_velocity": (3,), "_angular_velocity": (3,)}
_TIMES = ("sample_time_ns", "receive_time_ns", "publish_time_ns", "seq")
FARTHEST = 2**62  # the messages' bound of times and counters
_NONE = (np.nan,) * 7
_NO_VELOCITY = (np.nan,) * 3


class NpzSession:
    """One person's poses. A device that the file has no array for is absent throughout."""

    def __init__(
        self,
        path: Path,
        columns: tuple[str, ...],
        count: int,
        duration_s: float,
        avatar: str,
        space: Space,
        metadata: Mapping[str, str | float | bool],
    ) -> None:
        self.path, self.frame_count, self.duration_s, self.metadata = path, count, duration_s, metadata
        self.avatars: tuple[str, ...] = (avatar,)
        self.warnings: tuple[str, ...] = ()
        self._columns, self._avatar, self._space = columns, avatar, space

    def frames(self) -> Iterator[RecordedFrame]:
        """Read the frames in blocks. A pose that is not finite and unit comes without the flags it does not deserve."""
        with Archive(self.path) as archive, contextlib.ExitStack() as stack:
            columns = {name: archive.column(name) for name in self._columns}
            for column in columns.values():
                stack.callback(column.close)
            for start in range(0, self.frame_count, BLOCK):
                count = min(BLOCK, self.frame_count - start)
                yield from self._block(start, {name: column.take(count) for name, column in columns.items()})

    def _block(self, start: int, rows: Mapping[str, Any]) -> Iterator[RecordedFrame]:
        sample = _integers(rows["sample_time_ns"]) if "sample_time_ns" in rows else to_nanoseconds(rows["t"]).tolist()
        publish = _integers(rows["publish_time_ns"]) if "publish_time_ns" in rows else sample
        receive = _integers(rows["receive_time_ns"]) if "receive_time_ns" in rows else [None] * len(sample)
        seq = _integers(rows["seq"], lowest=0) if "seq" in rows else range(start, start + len(sample))
        devices = (_device(device, rows) for device in DEVICES)
        for number, sample_ns, publish_ns, receive_ns, head, left, right in zip(
            seq, sample, publish, receive, *devices, strict=True
        ):
            frame = ControllerFrame(VERSION, number, sample_ns, publish_ns, self._space, head, left, right)
            yield RecordedFrame(self._avatar, frame, receive_ns)

    def arms(self) -> Iterator[ArmsState]:
        """Nothing: these files hold no answers."""
        return iter(())

    def calibrations(self, avatar: str) -> tuple[RecordedProfile, ...]:
        """Nothing: these files hold no profile."""
        return ()


def _integers(rows: Any, lowest: int = -FARTHEST) -> list[int]:
    """Numbers as the messages bound them."""
    return np.clip(rows.astype(np.int64), lowest, FARTHEST).tolist()  # type: ignore[no-any-return]


def _device(device: str, rows: Mapping[str, Any]) -> Iterator[TrackedPose | None]:
    if device not in rows:
        return iter([None] * len(rows["t"]))
    raw = np.asarray(rows[device], np.float64)
    poses, deserved = clean_poses(raw)
    if f"{device}_flags" in rows:
        absent = np.asarray(np.isnan(raw).all(axis=1))
        present = [not row for row in absent.tolist()]
        flags = rows[f"{device}_flags"].astype(np.int64) & deserved
    else:
        present = [bool(valid) for valid in rows.get(f"{device}_valid", [True] * len(raw))]
        flags = deserved
    linear, angular = (_velocities(rows.get(f"{device}_{kind}_velocity"), len(raw)) for kind in ("linear", "angular"))
    tracked = to_tracked_poses(poses, flags, linear, angular)
    return (pose if there else None for pose, there in zip(tracked, present, strict=True))


def _velocities(rows: Any, count: int) -> list[Vector | None]:
    if rows is None:
        return [None] * count
    known = np.isfinite(rows).all(axis=1).tolist()
    return [tuple(row) if there else None for row, there in zip(rows.tolist(), known, strict=True)]


def open_npz(path: Path) -> NpzSession:
    """Look into an archive: which columns it has and that their shapes fit. Raises SessionError; see `open_session`."""
    with Archive(path) as archive:
        if "t" not in archive or not any(device in archive for device in DEVICES):
            raise SessionError(
                f"{path}: no session: it needs the arrays `t` and `head`, `left`, `right`, "
                f"but it holds {', '.join(archive.names[:8]) or 'no arrays'}"
            )
        times = _checked(archive, "t", None, ())
        count = times.shape[0]
        if count == 0:
            raise SessionError(f"{path}: the session holds no frames")
        columns = ["t", *(name for name in _TIMES if name in archive)]
        for name in columns[1:]:
            if _checked(archive, name, count, ()).dtype.kind not in "iu":
                raise SessionError(f"{path}: array `{name}` holds no integers")
        for device in (device for device in DEVICES if device in archive):
            _checked(archive, device, count, (7,))
            columns.append(device)
            for suffix, width in _WIDTH.items():
                if device + suffix in archive:
                    _checked(archive, device + suffix, count, width)
                    columns.append(device + suffix)
        first_ns, last_ns = _ends(times, count)
        avatar = str(archive.column("avatar").scalar()) if "avatar" in archive else DEFAULT_AVATAR
        space = str(archive.column("space").scalar()) if "space" in archive else "stage"
        metadata = {"format": "npz"} | (_metadata(archive.column("meta")) if "meta" in archive else {})
    try:
        check_id(avatar)
    except WireError as error:
        raise SessionError(f"{path}: `avatar`: {error}") from error
    for known in get_args(Space):
        if space == known:
            return NpzSession(path, tuple(columns), count, max(0, last_ns - first_ns) * 1e-9, avatar, known, metadata)
    raise SessionError(f"{path}: `space` is {space!r}; {', '.join(get_args(Space))} are known")


def _checked(archive: Archive, name: str, count: int | None, width: tuple[int, ...]) -> Column:
    column = archive.column(name)
    length = column.shape[0] if column.shape else 0
    if column.shape != (length if count is None else count, *width) or column.dtype.kind == "U":
        wanted = ", ".join(map(str, ("N" if count is None else count, *width)))
        raise SessionError(f"{archive.path}: array `{name}` has the shape {column.shape} instead of ({wanted})")
    return column


def _ends(times: Column, count: int) -> tuple[int, int]:
    first = last = 0
    for start in range(0, count, BLOCK):
        block = to_nanoseconds(times.take(min(BLOCK, count - start)))
        first = int(block[0]) if start == 0 else first
        last = int(block[-1])
    return first, last


def _metadata(column: Column) -> dict[str, str | float | bool]:
    try:
        found = msgspec.json.decode(str(column.scalar()))
    except (SessionError, msgspec.DecodeError):  # a note for people: its loss is no reason to refuse the poses
        return {}
    return {k: v for k, v in found.items() if isinstance(v, str | float | bool)} if isinstance(found, dict) else {}


class NpzSessionWriter:
    """Gathers the frames of one avatar; `save` writes them so that `open_npz` gives the same frames again."""

    def __init__(self, avatar: str) -> None:
        self._avatar = avatar
        self._space: Space | None = None
        self._start_ns: int | None = None
        fields: list[tuple[Any, ...]] = [("t", np.float64), *((name, np.int64) for name in _TIMES)]
        for device in DEVICES:
            fields += [(device, np.float64, (7,)), (f"{device}_valid", np.bool_), (f"{device}_flags", np.int64)]
            fields += [(f"{device}_{kind}_velocity", np.float64, (3,)) for kind in ("linear", "angular")]
        self._table = Table(fields)

    def __len__(self) -> int:
        return len(self._table)

    def write(self, recorded: RecordedFrame) -> None:
        """Add a frame; `t` counts from the first one."""
        frame, receive_ns = recorded.frame, recorded.receive_time_ns
        if self._start_ns is None:
            self._start_ns, self._space = frame.sample_time_ns, frame.space
        elif frame.space != self._space:
            raise SessionError(f"the session changes its space from {self._space} to {frame.space}: .npz holds one")
        sample_ns = frame.sample_time_ns
        self._table.append(
            (
                (sample_ns - self._start_ns) * 1e-9,
                sample_ns,
                sample_ns if receive_ns is None else receive_ns,
                frame.publish_time_ns,
                frame.seq,
                *_flat(frame.head),
                *_flat(frame.left),
                *_flat(frame.right),
            )
        )

    def save(self, path: Path) -> None:
        """Write the file. Raises SessionError if it cannot be written."""
        self._table.save(path, {"avatar": self._avatar, "space": self._space or "stage"})


def _flat(pose: TrackedPose | None) -> tuple[Any, ...]:
    if pose is None:
        return (_NONE, False, 0, _NO_VELOCITY, _NO_VELOCITY)
    return (
        (*pose.position, *pose.orientation),
        pose.flags & 3 == 3,
        pose.flags,
        pose.linear_velocity or _NO_VELOCITY,
        pose.angular_velocity or _NO_VELOCITY,
    )
