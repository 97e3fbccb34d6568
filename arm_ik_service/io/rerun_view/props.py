"""Things beside arms: boxes that are moved, and legs to walk on."""

from __future__ import annotations

import numpy as np
import rerun as rr

from arm_ik_service.io.rerun_view import figure
from arm_ik_service.io.rerun_view.entities import between_y, mesh_of
from arm_ik_service.io.rerun_view.rows import Floats
from arm_ik_service.io.rerun_view.solids import Colour
from arm_ik_service.io.rerun_view.timelines import time_columns
from arm_ik_service.wire.messages import SIDES

WOOD: Colour = (214, 158, 86)


class Box:
    """A cube at the entity `scene/<name>`; what is added is sent with `flush`."""

    def __init__(self, recording: rr.RecordingStream, name: str, edge_m: float) -> None:
        """Log the solid, static."""
        self._recording, self._entity = recording, f"scene/{name}"
        self._rows: list[tuple[int, int, Floats]] = []
        solid = rr.Boxes3D.from_fields(
            half_sizes=[[0.5 * edge_m] * 3], colors=[WOOD], fill_mode=rr.components.FillMode.Solid
        )
        recording.log(self._entity, solid, static=True)

    def add(self, frame: int, time_ns: int, pose: Floats) -> None:
        """Gather where its centre is (7,) [m]."""
        self._rows.append((frame, time_ns, pose))

    def flush(self) -> None:
        """Send what was gathered."""
        if not self._rows:
            return
        frames, times, poses = zip(*self._rows, strict=True)
        self._rows.clear()
        at = np.array(poses)
        self._recording.send_columns(
            self._entity,
            time_columns(np.array(frames, np.int64), np.array(times, np.int64)),
            rr.Transform3D.columns(translation=at[:, :3], quaternion=at[:, 3:]),
        )


class Legs:
    """The legs of an avatar, below the entity `root`; what is added is sent with `flush`."""

    def __init__(self, recording: rr.RecordingStream, root: str) -> None:
        """Log the solids, static."""
        self._recording, self._root = recording, root
        self._rows: list[tuple[int, int, Floats]] = []
        for side in SIDES:
            for name, solid in (("thigh", figure.thigh()), ("shank", figure.shank()), ("foot", figure.foot())):
                recording.log(f"{root}/{side}/{name}", mesh_of(solid), static=True)

    def add(self, frame: int, time_ns: int, joints: Floats) -> None:
        """Gather hip, knee, ankle and toe of left and right (2,4,3) [m]."""
        self._rows.append((frame, time_ns, joints))

    def flush(self) -> None:
        """Send what was gathered."""
        if not self._rows:
            return
        frames, times, rows = zip(*self._rows, strict=True)
        self._rows.clear()
        time = time_columns(np.array(frames, np.int64), np.array(times, np.int64))
        joints = np.array(rows)
        for k, side in enumerate(SIDES):
            for part, (name, length_m) in enumerate(
                (("thigh", figure.LEG_M), ("shank", figure.LEG_M), ("foot", figure.FOOT_M))
            ):
                start = joints[:, k, part]
                axis = joints[:, k, part + 1] - start
                scale = np.ones_like(axis)
                scale[:, 1] = np.linalg.norm(axis, axis=1) / length_m
                pose = rr.Transform3D.columns(translation=start, quaternion=between_y(axis), scale=scale)
                self._recording.send_columns(f"{self._root}/{side}/{name}", time, pose)
