"""Every axis convention of every dialect, and nothing else.

A dialect differs from ours in its world axes, which is a signed permutation, and in the axes of its bones. The bones of
VMC, BVH, ROS and Foxglove are all made alike: **in a T-pose, facing forward, every bone's axes are parallel to the
world's**. What is exported is then the rotation since the T-pose. XR_FB_body_tracking has bone axes of its own.

The T-pose: standing upright, facing -z of the OpenXR world; upper arms and forearms straight out to the sides and
level, elbows pointing back (so that bending them brings the hands together in front), palms down, fingers straight out.
In joint angles: abduction 90 degrees, pronation 90, all others 0. The clavicles are as `body/shoulders.py` rests them.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

from arm_ik_service.body.shoulders import STERNOCLAVICULAR
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.scalar import Quaternion, Vector
from arm_ik_service.wire.messages import Side

Segment = Literal["clavicle", "upper_arm", "forearm", "hand"]


class Axes(NamedTuple):
    """World axes: component i is `signs[i]` times our component `sources[i]`."""

    sources: tuple[int, int, int]
    signs: tuple[float, float, float]
    handedness: float  # -1 for left-handed axes

    def vector(self, v: Vector) -> Vector:
        """Give a vector in these axes."""
        (i, j, k), (a, b, c) = self.sources, self.signs
        return (a * v[i], b * v[j], c * v[k])

    def rotation(self, q: Quaternion) -> Quaternion:
        """Give a rotation in these axes, of something whose own axes change in the same way."""
        x, y, z = self.vector((q[0], q[1], q[2]))
        h = self.handedness
        return (h * x, h * y, h * z, q[3])


OPENXR = Axes((0, 1, 2), (1.0, 1.0, 1.0), 1.0)  # x right, y up, z back; BVH files of ours, too: y up
UNITY = Axes((0, 1, 2), (1.0, 1.0, -1.0), -1.0)  # left-handed: x right, y up, z forward
ROS = Axes((2, 0, 1), (-1.0, -1.0, 1.0), 1.0)  # REP-103: x forward, y left, z up; Foxglove draws z up as well

RIGHT, UP, BACK = g.X, g.Y, g.Z
LEFT, DOWN, FORWARD = (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)


def _clavicle() -> Quaternion:
    """ISB axes of the right clavicle at rest: +Z along the bone, from the sternum to the shoulder."""
    x, y, z = STERNOCLAVICULAR
    bone = (1.0 - x, -y, -z)
    to_right = g.scale(1.0 / g.norm(bone), bone)
    anterior = g.cross(UP, to_right)
    anterior = g.scale(1.0 / g.norm(anterior), anterior)
    return g.from_columns(anterior, g.cross(to_right, anterior), to_right)


# The segments' published axes (columns x, y, z) in the T-pose.
_RIGHT_T_POSE: dict[Segment, Quaternion] = {
    "clavicle": _clavicle(),
    "upper_arm": g.from_columns(FORWARD, LEFT, UP),  # ISB: +X anterior, +Y proximal, +Z the elbow's axis
    "forearm": g.from_columns(DOWN, LEFT, FORWARD),  # ISB, pronated by 90 degrees: its front faces down
    "hand": g.from_columns(BACK, UP, LEFT),  # OpenXR wrist frame: -Z to the fingers, +Y out of the back of the hand
}


def mirrored_segment(segment: Segment, q: Quaternion) -> Quaternion:
    """Reflect a segment's world rotation in the plane x = 0, as that of the same segment on the other side.

    The hand's own axes change sides as the world's do (x). ISB bones keep +Z to the person's right on both sides: half
    a turn about the bone's own axis.
    """
    reflected = g.mirror_rotation(q)
    return reflected if segment == "hand" else g.multiply(reflected, _HALF_TURN)


_HALF_TURN: Quaternion = (0.0, 1.0, 0.0, 0.0)
T_POSE: dict[Side, dict[Segment, Quaternion]] = {
    "right": _RIGHT_T_POSE,
    "left": {segment: mirrored_segment(segment, q) for segment, q in _RIGHT_T_POSE.items()},
}
T_POSE_PRONATION = math.pi / 2

# Meta's runtimes, by the table with which Godot's OpenXR vendors plugin turns their joints into its humanoid (OpenXR
# leaves the arm's axes open): on the right +X along the bone to the fingers, and in the T-pose +Y to the elbow's point
# on the arm, out of the back of the hand on the hand. On the left every axis is the opposite of the mirror image's.
FB_ARM: dict[Side, Quaternion] = {
    "right": g.from_columns(RIGHT, BACK, DOWN),
    "left": g.from_columns(RIGHT, FORWARD, UP),
}
FB_HAND: dict[Side, Quaternion] = {
    "right": g.from_columns(RIGHT, UP, BACK),
    "left": g.from_columns(RIGHT, DOWN, FORWARD),
}


def since_t_pose(side: Side, segment: Segment, world_from_segment: Quaternion) -> Quaternion:
    """Rotation, in world axes, that a segment has made since the T-pose."""
    return g.multiply(world_from_segment, g.conjugate(T_POSE[side][segment]))


def untwisted(side: Side, world_from_forearm: Quaternion, pronation: float, share: float) -> Quaternion:
    """Turn a forearm back so that it keeps a `share` of its pronation [rad], counted from the T-pose.

    With 0 it is the forearm as the elbow alone holds it; with 1 as published.
    """
    back = (share - 1.0) * (pronation - T_POSE_PRONATION)
    return g.multiply(world_from_forearm, g.rotation_y(back if side == "right" else -back))


def unity_euler_deg(q: Quaternion) -> Vector:
    """Unity's Euler angles x, y, z [deg] of a rotation in Unity axes: z is turned first, then x, then y."""
    x, y, z, w = q
    sine = 2.0 * (w * x - y * z)
    if abs(sine) > 1.0 - 1e-9:  # looking straight up or down: only the sum or difference of y and z is there
        return (math.copysign(90.0, sine), math.degrees(2.0 * math.atan2(y, w)), 0.0)
    return (
        math.degrees(math.asin(sine)),
        math.degrees(math.atan2(2.0 * (x * z + w * y), 1.0 - 2.0 * (x * x + y * y))),
        math.degrees(math.atan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z))),
    )


def bvh_euler_deg(q: Quaternion) -> Vector:
    """Angles z, x, y [deg] of BVH's channels `Zrotation Xrotation Yrotation`: the matrix product Rz Rx Ry."""
    x, y, z, w = q
    sine = 2.0 * (y * z + w * x)
    if abs(sine) > 1.0 - 1e-9:
        return (math.degrees(2.0 * math.atan2(z, w)), math.copysign(90.0, sine), 0.0)
    return (
        math.degrees(math.atan2(2.0 * (w * z - x * y), 1.0 - 2.0 * (x * x + z * z))),
        math.degrees(math.asin(sine)),
        math.degrees(math.atan2(2.0 * (w * y - x * z), 1.0 - 2.0 * (x * x + y * y))),
    )
