"""Things beside people: boxes that are moved."""

from __future__ import annotations

import numpy as np
import rerun as rr

from arm_ik_service.io.rerun_view.rows import Floats
from arm_ik_service.io.rerun_view.solids import Colour
from arm_ik_service.io.rerun_view.timelines import time_columns

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
