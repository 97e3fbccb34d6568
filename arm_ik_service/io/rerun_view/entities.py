"""What is logged of one avatar, and where: `avatar/<id>/...`. Solids once; then transforms, lines and numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import rerun as rr

from arm_ik_service.geometry import batch
from arm_ik_service.io.rerun_view import figure
from arm_ik_service.io.rerun_view.overlays import HIDDEN, ComfortOf, Overlay, OverlaySender
from arm_ik_service.io.rerun_view.palette import LATENCY_COLOURS, LIMIT, NAME, RESIDUAL, SIDE_COLOURS, STATE_COLOURS
from arm_ik_service.io.rerun_view.rows import ANGLES, LATENCIES, PLACES, Floats, Rows
from arm_ik_service.io.rerun_view.skinned import Skin, SkinSender
from arm_ik_service.io.rerun_view.solids import Solid
from arm_ik_service.io.rerun_view.timelines import Integers, time_columns
from arm_ik_service.wire.messages import SIDES, TRACKING_STATES, VERSION, ArmsState, Pose, Side, Skeleton, TrackingState

NECK_ROOT = (0.0, 0.065, 0.004)  # top of the torso in the chest frame [m]
GIRDLE_ROOT = (0.035, 0.014, 0.0)  # of the right side, in the chest frame [m]
SKULL_BASE = (0.0, -0.075, 0.082)  # in the head frame [m]
ABOVE_HEAD = (0.0, 0.33, 0.085)  # in the head frame [m]
LINE_RADIUS_M = 0.0035
BAND_MARGIN = 0.08  # of a joint's range: how far beyond it its plot shows what it cannot do
BAND_WIDTH = 3.0  # of the lines that fill it, one a frame
FOREARM_PER_STATURE, HAND_PER_FOREARM = 0.146, 0.108 / 0.146  # Drillis & Contini 1966


def entity_of(avatar: str) -> str:
    """Entity path of an avatar."""
    return rr.new_entity_path(["avatar", avatar]).lstrip("/")


def mesh_of(solid: Solid) -> rr.Mesh3D:
    """Return a solid as Rerun's archetype."""
    return rr.Mesh3D(
        vertex_positions=solid.vertices.astype(np.float32),
        vertex_normals=solid.normals.astype(np.float32),
        triangle_indices=solid.triangles,
        vertex_colors=solid.colours,
    )


def grips_of(skeleton: Skeleton) -> dict[Side, Pose]:
    """Return wrist_from_grip of both sides."""
    return {"left": skeleton.left_wrist_from_grip, "right": skeleton.right_wrist_from_grip}


def skeleton_of(arms: ArmsState) -> Skeleton:
    """Measure a person from one message, for want of a description: without limits."""
    bones = (arms.left.bones, arms.right.bones)
    upper_arm = sum(math.dist(b.upper_arm.position, b.forearm.position) for b in bones) / 2
    forearm = sum(math.dist(b.forearm.position, b.hand.position) for b in bones) / 2
    return Skeleton(
        version=VERSION,
        avatar=arms.avatar,
        stature_m=forearm / FOREARM_PER_STATURE,
        shoulder_width_m=math.dist(arms.left.bones.upper_arm.position, arms.right.bones.upper_arm.position),
        upper_arm_m=upper_arm,
        forearm_m=forearm,
        hand_m=forearm * HAND_PER_FOREARM,
        joint_limits=(),
        limit_names=(),
    )


def _solids(skeleton: Skeleton) -> dict[str, Solid]:
    parts = {"chest": figure.torso(skeleton.shoulder_width_m), "neck": figure.neck(), "head": figure.head()}
    for side in SIDES:
        parts[f"{side}/shoulder"] = figure.shoulder_girdle()
        parts[f"{side}/upper_arm"] = figure.upper_arm(side, skeleton.upper_arm_m)
        parts[f"{side}/forearm"] = figure.forearm(side, skeleton.forearm_m)
        parts[f"{side}/hand"] = figure.hand(side, skeleton.hand_m)
        parts[f"{side}/target"] = figure.controller()
    return parts


def log_styles(recording: rr.RecordingStream, root: str) -> None:
    """Log the names and colours of every line and band of one avatar, static."""
    sides = [SIDE_COLOURS[side] for side in SIDES]
    for name in ANGLES:
        recording.log(
            f"{root}/plots/angles/{name}",
            rr.SeriesLines(
                colors=[LIMIT, LIMIT, *sides],
                widths=[BAND_WIDTH, BAND_WIDTH, 1.6, 1.6],
                names=["below its range", "above its range", *SIDES],
                aggregation_policy="MinMax",  # a mean would draw the bands in
            ),
            static=True,
        )
        recording.log(
            f"{root}/plots/rates/{name}", rr.SeriesLines(colors=sides, widths=[1.6] * 2, names=SIDES), static=True
        )
    recording.log(f"{root}/plots/residual_mm", rr.SeriesLines(colors=sides, widths=[1.6] * 2, names=SIDES), static=True)
    recording.log(
        f"{root}/plots/latency_ms",
        rr.SeriesLines(colors=LATENCY_COLOURS, widths=[1.4] * 3, names=LATENCIES),
        static=True,
    )
    for side in SIDES:
        recording.log(
            f"{root}/{side}/residual",
            rr.LineStrips3D.from_fields(colors=[RESIDUAL], radii=[LINE_RADIUS_M]),
            static=True,
        )
        recording.log(
            f"{root}/plots/tracking/{side}",
            rr.StateConfiguration(values=TRACKING_STATES, colors=[STATE_COLOURS[state] for state in TRACKING_STATES]),
            static=True,
        )


def log_name(recording: rr.RecordingStream, root: str, name: str) -> None:
    """Log a name above the head, static."""
    label = rr.Points3D([ABOVE_HEAD], radii=[0.001], colors=[NAME], labels=[name], show_labels=True)
    recording.log(f"{root}/head/name", label, static=True)


def between_y(direction: Floats) -> Floats:
    """Shortest rotations (N,4) that take +Y to the directions (N,3), which need not be of unit length."""
    d = batch.normalized(direction)
    aside = d[:, 0] ** 2 + d[:, 2] ** 2
    # 1 + y, without its cancellation where a solid hangs straight down, as legs do
    w = np.where(d[:, 1] < 0.0, aside / (1.0 - np.minimum(d[:, 1], 0.0)), 1.0 + d[:, 1])
    turned = np.stack([d[:, 2], np.zeros(len(d)), -d[:, 0], w], axis=-1)
    turned[(d[:, 1] < 0.0) & (aside < 1e-24)] = (1.0, 0.0, 0.0, 0.0)
    return batch.normalized(turned)


def spanning(start: Floats, end: Floats, length_m: float) -> rr.ComponentColumnList:
    """Columns that stretch a solid built along +Y, `length_m` long, from start to end (N,3)."""
    axis = end - start
    scale = np.ones_like(axis)
    scale[:, 1] = np.linalg.norm(axis, axis=1) / length_m
    return rr.Transform3D.columns(translation=start, quaternion=between_y(axis), scale=scale)


class Sender:
    """Sends the gathered rows of one avatar as columns."""

    def __init__(
        self,
        recording: rr.RecordingStream,
        root: str,
        skin: Skin | None = None,
        show: frozenset[Overlay] = frozenset(),
        comfort: ComfortOf | None = None,
    ) -> None:
        self._overlays = OverlaySender(recording, root, show, comfort)
        self._skin = SkinSender(recording, root, skin) if skin is not None else None
        self._replaced = skin.replaces if skin is not None else set()
        self._tints_hands = skin is None or skin.arms_only
        self._limits_deg: Floats = np.full((len(ANGLES), 2), np.nan)
        self._wrist_from_grip: dict[Side, Floats] = {}
        self._lengths_m: dict[str, float] = {}
        self._sent = 0  # rows
        self._recording = recording
        self._root = root
        self._states: dict[Side, TrackingState | None] = dict.fromkeys(SIDES)
        self._time: list[rr.TimeColumn] = []

    def describe(self, skeleton: Skeleton) -> None:
        """Log the solids, static; from now on the plots have these limits, the residual line starts at these grips."""
        for name, solid in _solids(skeleton).items():
            if name not in self._replaced:
                self._recording.log(f"{self._root}/{name}", mesh_of(solid), static=True)
        if self._skin is not None:
            self._skin.describe(skeleton)
        self._overlays.describe(skeleton)
        self._lengths_m = {"upper_arm": skeleton.upper_arm_m, "forearm": skeleton.forearm_m}
        limits = {limit.name: (limit.lower, limit.upper) for limit in skeleton.joint_limits}
        self._limits_deg = np.rad2deg([limits.get(name, (np.nan, np.nan)) for name in ANGLES])
        self._wrist_from_grip = {
            side: np.array([*grip.position, *grip.orientation]) for side, grip in grips_of(skeleton).items()
        }

    def send(self, rows: Rows) -> None:
        """Log all of `rows` under their own times, in their order."""
        if not len(rows):
            return
        values = np.array(rows.values)
        frames, times = np.array(rows.frames, np.int64), np.array(rows.times_ns, np.int64)
        self._time = time_columns(frames, times)
        self._send_trunk(values)
        if self._skin is not None:
            self._skin.send(values, frames, times)
        for k, side in enumerate(SIDES):
            self._send_side(side, values)
            self._send_state(side, [pair[k] for pair in rows.states], frames, times)
        self._overlays.send(values, self._time, times, self._wrist_from_grip)
        self._send_plots(values)

    def _columns(self, entity: str, columns: Iterable[rr.ComponentColumn]) -> None:
        self._recording.send_columns(f"{self._root}/{entity}", self._time, columns)

    def _move(self, entity: str, pose: Floats) -> None:
        self._columns(entity, rr.Transform3D.columns(translation=pose[:, :3], quaternion=pose[:, 3:]))

    def _stretch(self, entity: str, bone: Floats, end: Floats, length_m: float) -> None:
        """Move a solid that is built down -Y, `length_m` long, and make it end at `end`: lengths may be learnt."""
        scale = np.ones((len(bone), 3))
        scale[:, 1] = np.linalg.norm(end[:, :3] - bone[:, :3], axis=1) / length_m
        self._columns(entity, rr.Transform3D.columns(translation=bone[:, :3], quaternion=bone[:, 3:], scale=scale))

    def _send_trunk(self, values: Floats) -> None:
        chest, head = values[:, PLACES["chest"]], values[:, PLACES["head"]]
        self._move("chest", chest)
        self._move("head", head)
        root = chest[:, :3] + batch.rotate(chest[:, 3:], NECK_ROOT)
        top = head[:, :3] + batch.rotate(head[:, 3:], SKULL_BASE)
        self._columns("neck", spanning(root, top, figure.NECK_M))

    def _send_side(self, side: Side, values: Floats) -> None:
        upper_arm, forearm, hand, target = (
            values[:, PLACES[f"{side}/{name}"]] for name in ("upper_arm", "forearm", "hand", "target")
        )
        chest = values[:, PLACES["chest"]]
        x, y, z = GIRDLE_ROOT
        root = chest[:, :3] + batch.rotate(chest[:, 3:], (-x if side == "left" else x, y, z))
        self._columns(f"{side}/shoulder", spanning(root, upper_arm[:, :3], figure.GIRDLE_M))
        for name, bone, end in (("upper_arm", upper_arm, forearm), ("forearm", forearm, hand)):
            self._stretch(f"{side}/{name}", bone, end, self._lengths_m[name])
        self._move(f"{side}/hand", hand)

        there = np.isfinite(target).all(axis=1, keepdims=True)
        shown = np.where(there, target, hand)
        self._columns(
            f"{side}/target",
            rr.Transform3D.columns(
                translation=shown[:, :3],
                quaternion=shown[:, 3:],
                scale=np.repeat(np.where(there, 1.0, HIDDEN), 3, axis=1),
            ),
        )
        held = batch.compose(hand, self._wrist_from_grip[side])[:, :3]
        line = np.stack([held, np.where(there, target[:, :3], held)], axis=1)
        self._columns(f"{side}/residual", rr.LineStrips3D.columns(strips=line))

    def _send_state(self, side: Side, states: list[TrackingState], frames: Integers, times: Integers) -> None:
        """Log the state where it changes: the band of the plot and the colour of the hand."""
        before = [self._states[side], *states[:-1]]
        changed = [k for k, (a, b) in enumerate(zip(before, states, strict=True)) if a != b]
        self._states[side] = states[-1]
        if not changed:
            return
        time = time_columns(frames[changed], times[changed])
        new = [states[k] for k in changed]
        colours = np.array([(*STATE_COLOURS[state], 255) for state in new], np.uint8)
        if self._tints_hands:
            self._recording.send_columns(f"{self._root}/{side}/hand", time, rr.Mesh3D.columns(albedo_factor=colours))
        self._recording.send_columns(f"{self._root}/plots/tracking/{side}", time, rr.StateChange.columns(state=new))

    def _scalars(self, entity: str, series: Floats) -> None:
        count, width = series.shape
        self._columns(f"plots/{entity}", rr.Scalars.columns(scalars=series.reshape(-1)).partition([width] * count))

    def _send_plots(self, values: Floats) -> None:
        angles = [np.rad2deg(values[:, PLACES[f"{side}/angles"]]) for side in SIDES]
        rates = [np.rad2deg(values[:, PLACES[f"{side}/rates"]]) for side in SIDES]
        # Rerun fills no areas: a line that goes to and fro between two heights at every frame looks like one
        fro = (np.arange(self._sent, self._sent + len(values)) % 2).astype(float)
        self._sent += len(values)
        for k, name in enumerate(ANGLES):
            lower, upper = self._limits_deg[k]
            beyond = BAND_MARGIN * (upper - lower) * fro
            self._scalars(
                f"angles/{name}", np.stack([lower - beyond, upper + beyond, *(a[:, k] for a in angles)], axis=1)
            )
            self._scalars(f"rates/{name}", np.stack([r[:, k] for r in rates], axis=1))
        residual = [values[:, PLACES[f"{side}/residual_mm"]] for side in SIDES]
        self._scalars("residual_mm", np.concatenate(residual, axis=1))
        self._scalars("latency_ms", values[:, PLACES["latency_ms"]])
