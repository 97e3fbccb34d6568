"""Things beside arms: boxes that are moved, and legs to walk on."""

from __future__ import annotations

import numpy as np
import rerun as rr

from arm_ik_service.io.rerun_view import figure
from arm_ik_service.io.rerun_view.entities import mesh_of, spanning
from arm_ik_service.io.rerun_view.rows import Floats
from arm_ik_service.io.rerun_view.solids import Colour
from arm_ik_service.io.rerun_view.timelines import time_columns
from arm_ik_service.wire.messages import SIDES

WOOD: Colour = (214, 158, 86)


class _Prop:
    """Gathers a row a frame, and sends them with `flush`."""

    def __init__(self) -> None:
        self._rows: list[tuple[int, int, Floats]] = []

    def add(self, frame: int, time_ns: int, row: Floats) -> None:
        """Gather where it is [m]."""
        self._rows.append((frame, time_ns, row))

    def flush(self) -> None:
        """Send what was gathered."""
        if not self._rows:
            return
        frames, times, rows = zip(*self._rows, strict=True)
        self._rows.clear()
        self._send(time_columns(np.array(frames, np.int64), np.array(times, np.int64)), np.array(rows))

    def _send(self, time: list[rr.TimeColumn], rows: Floats) -> None:
        raise NotImplementedError


class Box(_Prop):
    """A cube at the entity `scene/<name>`; a row is the pose (7,) of its centre."""

    def __init__(self, recording: rr.RecordingStream, name: str, edge_m: float) -> None:
        """Log the solid, static."""
        super().__init__()
        self._recording, self._entity = recording, f"scene/{name}"
        solid = rr.Boxes3D.from_fields(
            half_sizes=[[0.5 * edge_m] * 3], colors=[WOOD], fill_mode=rr.components.FillMode.Solid
        )
        recording.log(self._entity, solid, static=True)

    def _send(self, time: list[rr.TimeColumn], rows: Floats) -> None:
        pose = rr.Transform3D.columns(translation=rows[:, :3], quaternion=rows[:, 3:])
        self._recording.send_columns(self._entity, time, pose)


class Legs(_Prop):
    """The legs of an avatar, below the entity `root`; a row is hip, knee, ankle and toe of left and right (2,4,3)."""

    def __init__(self, recording: rr.RecordingStream, root: str) -> None:
        """Log the solids, static."""
        super().__init__()
        self._recording, self._root = recording, root
        for side in SIDES:
            for name, solid in (("thigh", figure.thigh()), ("shank", figure.shank()), ("foot", figure.foot())):
                recording.log(f"{root}/{side}/{name}", mesh_of(solid), static=True)

    def _send(self, time: list[rr.TimeColumn], rows: Floats) -> None:
        parts = (("thigh", figure.LEG_M), ("shank", figure.LEG_M), ("foot", figure.FOOT_M))
        for k, side in enumerate(SIDES):
            for part, (name, length_m) in enumerate(parts):
                columns = spanning(rows[:, k, part], rows[:, k, part + 1], length_m)
                self._recording.send_columns(f"{self._root}/{side}/{name}", time, columns)
