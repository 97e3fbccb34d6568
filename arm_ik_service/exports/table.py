"""The joint stream as a table for analysis, a row a state: CSV or Parquet, units in the names of the columns.

World axes are OpenXR's (x right, y up, z back); quaternions x y z w; bones in ISB axes, the hand in the
OpenXR wrist frame.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from arm_ik_service.errors import SessionError
from arm_ik_service.exports.joints import ANGLE_NAMES, values_of
from arm_ik_service.wire.messages import SIDES, ArmsState, ArmState, Pose

ROWS = 4096  # a block: a few megabytes, whatever the length of the session
BONES = ("clavicle", "upper_arm", "forearm", "hand")


def _pose_columns(name: str) -> list[tuple[str, Any]]:
    return [(f"{name}_{axis}_m", pa.float64()) for axis in "xyz"] + [
        (f"{name}_q{axis}", pa.float64()) for axis in "xyzw"
    ]


def _arm_columns(side: str) -> list[tuple[str, Any]]:
    number = pa.float64()
    columns: list[tuple[str, Any]] = [(f"{side}_tracking", pa.string())]
    columns += [(f"{side}_{name}_rad", number) for name in ANGLE_NAMES]
    columns += [(f"{side}_{name}_rad_s", number) for name in ANGLE_NAMES]
    for bone in BONES:
        columns += _pose_columns(f"{side}_{bone}")
    columns += [(f"{side}_{name}", number) for name in ("position_error_m", "orientation_error_rad", "reach_ratio")]
    columns += [
        (f"{side}_elbow_confidence", number),
        (f"{side}_iterations", pa.int64()),
        (f"{side}_limits", pa.string()),
    ]
    return columns


SCHEMA = pa.schema(
    [
        ("avatar", pa.string()),
        ("seq", pa.int64()),
        ("sample_time_ns", pa.int64()),
        *_pose_columns("head"),
        *_pose_columns("chest"),
        *(column for side in SIDES for column in _arm_columns(side)),
    ],
    metadata={
        "axes": "OpenXR world: x right, y up, z back; quaternions x y z w",
        "bones": "ISB axes (x anterior, y proximal, z right); hand: OpenXR wrist frame",
    },
)


class TableWriter:
    """A `.csv` or `.parquet` file being written, block by block."""

    def __init__(self, path: Path) -> None:
        """Create the file. Raises SessionError if it cannot be written."""
        self.path = path
        self._rows: list[tuple[Any, ...]] = []
        kind: Any = pa.csv.CSVWriter if path.suffix == ".csv" else pa.parquet.ParquetWriter
        try:
            self._writer = kind(str(path), SCHEMA)
        except OSError as error:
            raise SessionError(f"{path}: cannot be written: {error.strerror or error}") from error

    def add(self, state: ArmsState) -> None:
        """Add one state."""
        self._rows.append(_row(state))
        if len(self._rows) == ROWS:
            self._flush()

    def close(self) -> None:
        """Write what is left and end the file."""
        self._flush()
        self._writer.close()

    def _flush(self) -> None:
        if self._rows:
            columns = [pa.array(c, type=f.type) for c, f in zip(zip(*self._rows, strict=True), SCHEMA, strict=True)]
            self._writer.write_batch(pa.record_batch(columns, schema=SCHEMA))
            self._rows.clear()


def _pose(pose: Pose) -> tuple[float, ...]:
    return (*pose.position, *pose.orientation)


def _arm(arm: ArmState) -> tuple[Any, ...]:
    bones = arm.bones
    return (
        arm.tracking,
        *values_of(arm.angles),
        *values_of(arm.angle_rates),
        *_pose(bones.clavicle),
        *_pose(bones.upper_arm),
        *_pose(bones.forearm),
        *_pose(bones.hand),
        arm.position_error_m,
        arm.orientation_error_rad,
        arm.reach_ratio,
        arm.elbow_confidence,
        arm.iterations,
        " ".join(arm.limits),
    )


def _row(state: ArmsState) -> tuple[Any, ...]:
    return (
        state.avatar,
        state.seq,
        state.sample_time_ns,
        *_pose(state.head),
        *_pose(state.chest),
        *_arm(state.left),
        *_arm(state.right),
    )
