"""What explains an arm beside showing it, logged only where it is asked for: below `<avatar>/<side>/`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, get_args

import numpy as np
import rerun as rr

from arm_ik_service.geometry import batch
from arm_ik_service.io.rerun_view import figure
from arm_ik_service.io.rerun_view.gauges import (
    DIALS,
    Arm,
    Flags,
    dial,
    elbow_bracket,
    elbow_circle,
    swing_region,
)
from arm_ik_service.io.rerun_view.palette import AT_LIMIT, COMFORT, FAINT, GHOST, RANGE, REACH, SIDE_COLOURS
from arm_ik_service.io.rerun_view.rows import ANGLES, PLACES, RESTS, Floats
from arm_ik_service.io.rerun_view.solids import Colour
from arm_ik_service.io.rerun_view.timelines import Integers
from arm_ik_service.wire.messages import SIDES, Side, Skeleton

# Of an arm and the times (N,) [ns] of its frames: the swivels (N,2) [rad] from the elbow that are comfortable.
ComfortOf = Callable[[Skeleton, Arm, Integers], Floats]
Overlay = Literal["reach", "swivel", "limits", "ghost"]
OVERLAYS: tuple[Overlay, ...] = get_args(Overlay)
LEGEND: dict[Overlay, str] = {
    "reach": "**Ball**: what the wrist can reach.",
    "swivel": "**Ring**: the elbow's circle, bright where the shoulder lets it; **bracket**: where it is comfortable.",
    "limits": "**Rose**: ranges of the joints, needle: their angle, red: at the limit.",
    "ghost": "**Pale hand**: the raw target's.",
}
HIDDEN = 1e-6  # scale of what is not there
THIN_M, THICK_M = 0.0015, 0.0035  # radii of lines


class OverlaySender:
    """Draws the chosen overlays of one avatar, below the entity `root`."""

    def __init__(
        self, recording: rr.RecordingStream, root: str, show: frozenset[Overlay], comfort: ComfortOf | None = None
    ) -> None:
        self._recording, self._root, self._show, self._comfort = recording, root, show, comfort
        self._skeleton: Skeleton | None = None
        self._time: list[rr.TimeColumn] = []

    def describe(self, skeleton: Skeleton) -> None:
        """Log what does not move by itself; from now on these are the lengths and limits."""
        self._skeleton = skeleton
        for side in SIDES:
            if "reach" in self._show:
                # of radius 1, so that it can be scaled to arms whose length is learnt
                ball = rr.Ellipsoids3D.from_fields(
                    half_sizes=[[1.0] * 3],
                    colors=[(*SIDE_COLOURS[side], REACH)],
                    line_radii=[THIN_M],
                    fill_mode=rr.components.FillMode.TransparentFillMajorWireframe,
                )
                self._log(f"{side}/reach", ball)
            if "ghost" in self._show:
                hand = figure.hand(side, skeleton.hand_m)
                self._log(
                    f"{side}/ghost",
                    rr.Mesh3D(
                        vertex_positions=hand.vertices.astype(np.float32),
                        vertex_normals=hand.normals.astype(np.float32),
                        triangle_indices=hand.triangles,
                        albedo_factor=GHOST,
                    ),
                )
            if "swivel" in self._show:
                colours = [FAINT, SIDE_COLOURS[side], SIDE_COLOURS[side], COMFORT]
                self._log(f"{side}/swivel", _lines(colours, (1, 2, 1, 2)))

    def send(
        self, values: Floats, time: list[rr.TimeColumn], times_ns: Integers, wrist_from_grip: dict[Side, Floats]
    ) -> None:
        """Log rows (N, WIDTH) under their times."""
        self._time = time
        for side in SIDES:
            arm = Arm.of(side, values)
            if "reach" in self._show:
                self._send_reach(arm)
            if "swivel" in self._show:
                self._send_swivel(arm, times_ns)
            if "limits" in self._show:
                self._send_limits(arm, values[:, PLACES[f"{side}/rests"]] > 0.5)
            if "ghost" in self._show:
                self._send_ghost(arm, values[:, PLACES[f"{side}/target"]], wrist_from_grip[side])

    def _log(self, entity: str, what: rr.AsComponents) -> None:
        self._recording.log(f"{self._root}/{entity}", what, static=True)

    def _columns(self, entity: str, columns: rr.ComponentColumnList) -> None:
        self._recording.send_columns(f"{self._root}/{entity}", self._time, columns)

    def _send_reach(self, arm: Arm) -> None:
        shoulder, elbow, wrist = arm.upper_arm[:, :3], arm.forearm[:, :3], arm.hand[:, :3]
        length = np.linalg.norm(elbow - shoulder, axis=1) + np.linalg.norm(wrist - elbow, axis=1)
        scale = np.repeat(length[:, None], 3, axis=1)
        # the chest's rotation, so that the wires of both sides run alike
        pose = rr.Transform3D.columns(translation=shoulder, quaternion=arm.chest[:, 3:], scale=scale)
        self._columns(f"{arm.side}/reach", pose)

    def _send_swivel(self, arm: Arm, times_ns: Integers) -> None:
        assert self._skeleton is not None
        strips = [*elbow_circle(arm, self._skeleton.shoulder_swing)]
        if self._comfort is not None:
            strips.append(elbow_bracket(arm, self._comfort(self._skeleton, arm, times_ns)))
        self._columns(f"{arm.side}/swivel", _strip_columns(np.stack(strips, axis=1)))

    def _send_limits(self, arm: Arm, rests: Flags) -> None:
        assert self._skeleton is not None
        limits = {limit.name: (limit.lower, limit.upper) for limit in self._skeleton.joint_limits}
        drawn = [name for name in DIALS if name in limits and name in ANGLES]
        dials = [dial(arm, name, *limits[name]) for name in drawn]
        if dials:
            strips = np.stack([line for pair in dials for line in pair], axis=1)
            active = rests[:, [RESTS.index(name) for name in drawn]].repeat(2, axis=1)
            idle = np.array([RANGE, SIDE_COLOURS[arm.side]] * len(drawn))
            radii = np.tile([THIN_M, THICK_M], len(drawn))
            self._columns(f"{arm.side}/limits/joints", _strip_columns(strips, _coloured(idle, active), radii))
        if (region := self._skeleton.shoulder_swing) is not None:
            outline = swing_region(arm, region)[:, None]
            colours = _coloured(np.array([RANGE]), rests[:, :1])
            self._columns(f"{arm.side}/limits/swing", _strip_columns(outline, colours, np.array([THIN_M])))

    def _send_ghost(self, arm: Arm, target: Floats, wrist_from_grip: Floats) -> None:
        there = np.isfinite(target).all(axis=1, keepdims=True)
        wrist = batch.compose(np.where(there, target, arm.hand), batch.inverse(wrist_from_grip))
        scale = np.repeat(np.where(there, 1.0, HIDDEN), 3, axis=1)
        pose = rr.Transform3D.columns(translation=wrist[:, :3], quaternion=wrist[:, 3:], scale=scale)
        self._columns(f"{arm.side}/ghost", pose)


def _lines(colours: list[Colour], widths: tuple[int, ...]) -> rr.LineStrips3D:
    return rr.LineStrips3D.from_fields(colors=colours, radii=[THIN_M * width for width in widths])


def _coloured(idle: Floats, active: Flags) -> Floats:
    """Colours (N,S,3) of lines: `idle` (S,3), or that of a limit the arm rests on."""
    return np.where(active[:, :, None], AT_LIMIT, idle).astype(np.uint8)


def _strip_columns(
    strips: Floats, colours: Floats | None = None, radii: Floats | None = None
) -> rr.ComponentColumnList:
    """Columns of strips (N,S,P,3), with colours (N,S,3) and radii (S,) where they are not static."""
    count, lines = strips.shape[:2]
    return rr.LineStrips3D.columns(
        strips=strips.reshape(count * lines, *strips.shape[2:]).astype(np.float32),
        colors=None if colours is None else colours.reshape(-1, 3),
        radii=None if radii is None else np.tile(radii, count),
    ).partition([lines] * count)
