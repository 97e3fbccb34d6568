"""Foxglove's own schemas, in protobuf: FrameTransforms, JointStates and a SceneUpdate with a body to look at.

Frames are those of `frames.py` (z up, `world` at the root). The solids are locked to the frames of their bones, so they
move with every FrameTransforms message; they are sent again each second and when the tracking of an arm changes, which
is seen in its colour.
"""

from __future__ import annotations

from foxglove.messages import (
    Color,
    CubePrimitive,
    CylinderPrimitive,
    FrameTransform,
    FrameTransforms,
    JointState,
    JointStates,
    Pose,
    Quaternion,
    SceneEntity,
    SceneUpdate,
    SpherePrimitive,
    Timestamp,
    Vector3,
)

from arm_ik_service.body.profile import HAND_PER_STATURE, UPPER_ARM_PER_STATURE
from arm_ik_service.exports.frames import Frame
from arm_ik_service.exports.joints import JOINT_NAMES, positions_of, velocities_of
from arm_ik_service.geometry import scalar as g
from arm_ik_service.wire.messages import ArmsState, TrackingState
from arm_ik_service.wire.messages import Quaternion as Rotation
from arm_ik_service.wire.messages import Vector as Numbers

NANOSECONDS = 1_000_000_000
SCENE_EVERY_NS = NANOSECONDS
LAST_SECOND = 2**32 - 1

COLOURS: dict[TrackingState, Color] = {
    "tracked": Color(r=0.85, g=0.68, b=0.55, a=1.0),
    "inferred": Color(r=0.90, g=0.75, b=0.20, a=1.0),
    "held": Color(r=0.90, g=0.45, b=0.15, a=1.0),
    "lost": Color(r=0.60, g=0.60, b=0.60, a=0.6),
}
BODY = Color(r=0.45, g=0.50, b=0.58, a=1.0)
HEAD_SIZE = Vector3(x=0.19, y=0.15, z=0.23)
HEAD_CENTRE = (-0.09, 0.0, 0.0)  # behind the eyes, which is where a headset is
THICKNESS_M = {"clavicle": 0.03, "upper_arm": 0.09, "forearm": 0.07}
JOINT_M = {"upper_arm": 0.10, "forearm": 0.08, "hand": 0.06}
PALM_M = (0.084, 0.03)  # breadth, thickness


def frame_transforms(frames: list[Frame], time_ns: int) -> bytes:
    """Encode the frame tree of one state."""
    stamp = _timestamp(time_ns)
    return FrameTransforms(
        transforms=[
            FrameTransform(
                timestamp=stamp,
                parent_frame_id=frame.parent,
                child_frame_id=frame.child,
                translation=_vector(frame.position),
                rotation=_quaternion(frame.rotation),
            )
            for frame in frames
        ]
    ).encode()


def joint_states(state: ArmsState, time_ns: int) -> bytes:
    """Encode the angles [rad] and their rates [rad/s] of both arms."""
    values = zip(JOINT_NAMES, positions_of(state), velocities_of(state), strict=True)
    joints = [JointState(name=name, position=position, velocity=velocity) for name, position, velocity in values]
    return JointStates(timestamp=_timestamp(time_ns), joints=joints).encode()


class Scene:
    """The solids of one avatar; remembers when it last sent them, and in which colours."""

    def __init__(self) -> None:
        self._sent_ns: int | None = None
        self._states: tuple[TrackingState, TrackingState] | None = None

    def update(self, state: ArmsState, frames: list[Frame], time_ns: int) -> bytes | None:
        """Encode the solids if they are due: lengths are those of the frames given."""
        states = (state.left.tracking, state.right.tracking)
        if self._sent_ns is not None and self._states == states and 0 <= time_ns - self._sent_ns < SCENE_EVERY_NS:
            return None
        self._sent_ns, self._states = time_ns, states
        stamp = _timestamp(time_ns)
        by_name = {frame.child.rpartition("/")[2]: frame for frame in frames}
        entities = [_entity(by_name["head"], stamp, spheres=[_sphere(HEAD_CENTRE, HEAD_SIZE, BODY)])]
        for side, tracking in zip(("left", "right"), states, strict=True):
            entities += _arm(by_name, side, stamp, COLOURS[tracking])
        return SceneUpdate(entities=entities).encode()


def _arm(frames: dict[str, Frame], side: str, stamp: Timestamp, colour: Color) -> list[SceneEntity]:
    """Give the solids of one arm: in its own frame each bone ends where the next frame begins."""
    entities = []
    for bone, following in (("clavicle", "upper_arm"), ("upper_arm", "forearm"), ("forearm", "hand")):
        frame, end = frames[f"{side}_{bone}"], frames[f"{side}_{following}"].position
        thickness = THICKNESS_M[bone]
        cylinder = CylinderPrimitive(
            pose=Pose(
                position=_vector(g.scale(0.5, end)),
                orientation=_quaternion(g.between(g.Z, g.scale(1.0 / max(g.norm(end), 1e-9), end))),
            ),
            size=Vector3(x=thickness, y=thickness, z=g.norm(end)),
            bottom_scale=1.0,
            top_scale=0.8,
            color=BODY if bone == "clavicle" else colour,
        )
        spheres = [_ball(JOINT_M[bone], colour)] if bone in JOINT_M else []
        entities.append(_entity(frame, stamp, cylinders=[cylinder], spheres=spheres))
    hand_m = g.norm(frames[f"{side}_forearm"].position) * HAND_PER_STATURE / UPPER_ARM_PER_STATURE
    outwards = 1.0 if side == "left" else -1.0  # y is left
    palm = CubePrimitive(
        pose=Pose(position=Vector3(x=0.0, y=outwards * 0.5 * hand_m, z=0.0), orientation=Quaternion(w=1.0)),
        size=Vector3(x=PALM_M[0], y=hand_m, z=PALM_M[1]),
        color=colour,
    )
    entities.append(_entity(frames[f"{side}_hand"], stamp, cubes=[palm], spheres=[_ball(JOINT_M["hand"], colour)]))
    return entities


def _entity(
    frame: Frame,
    stamp: Timestamp,
    cubes: list[CubePrimitive] | None = None,
    spheres: list[SpherePrimitive] | None = None,
    cylinders: list[CylinderPrimitive] | None = None,
) -> SceneEntity:
    return SceneEntity(
        timestamp=stamp,
        frame_id=frame.child,
        id=frame.child,
        frame_locked=True,
        cubes=cubes or [],
        spheres=spheres or [],
        cylinders=cylinders or [],
    )


def _ball(diameter: float, colour: Color) -> SpherePrimitive:
    return _sphere((0.0, 0.0, 0.0), Vector3(x=diameter, y=diameter, z=diameter), colour)


def _sphere(centre: Numbers, size: Vector3, colour: Color) -> SpherePrimitive:
    pose = Pose(position=_vector(centre), orientation=Quaternion(w=1.0))
    return SpherePrimitive(pose=pose, size=size, color=colour)


def _vector(v: Numbers) -> Vector3:
    return Vector3(x=v[0], y=v[1], z=v[2])


def _quaternion(q: Rotation) -> Quaternion:
    return Quaternion(x=q[0], y=q[1], z=q[2], w=q[3])


def _timestamp(time_ns: int) -> Timestamp:
    sec, nsec = divmod(max(0, time_ns), NANOSECONDS)
    return Timestamp(sec=min(sec, LAST_SECOND), nsec=nsec)
