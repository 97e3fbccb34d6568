"""Both arms with hands as one skinned mesh: shape, bones, weights, and an A-pose with the thumbs up."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from arm_ik_service.geometry import batch
from arm_ik_service.skin.blend import skin
from arm_ik_service.skin.builtin.polygonise import gradient, open_edge, rings, surface_net, zip_up
from arm_ik_service.skin.builtin.solid import UPPER_ARM_M, WRIST_Y, distance, limb
from arm_ik_service.skin.mesh import SKIN_COLOUR, Floats, Integers, SkinnedMesh, pack_weights, vertex_normals
from arm_ik_service.skin.twist import split

AROUND = 24  # vertices of a ring: 1 cm apart at the forearm
RING_M = 0.012  # from ring to ring
TOP_M = 0.0575  # the first ring, above the shoulder joint
WIDEST_M = 0.08  # more than any half width of the limb
NET_M = 0.0033  # grid of the hand: finer than the gaps between fingers
SEAM_M = 0.012  # from the last ring to the hand's rim, above the wrist joint

HALF_SHOULDER_WIDTH_M = 0.18
RAISED = np.radians(45.0)  # of the upper arm at rest, to the side
PRONATED = np.radians(85.0)  # at rest, the middle of the range: the twist then never exceeds 90 degrees
ELBOW_BLEND_M, WRIST_BLEND_M = 0.045, 0.022  # half the length over which a joint's two bones share the skin

BONES = ("UpperArm", "LowerArm", "Hand")
_KNUCKLES = {"IndexProximal": (-0.001, -0.089, 0.0315), "LittleProximal": (-0.001, -0.082, -0.0295)}


@cache
def built_in_arms() -> SkinnedMesh:
    """Return the mesh (14 700 vertices) in OpenXR axes, the middle between the shoulders at the origin."""
    right = _at_rest(_straight_arm())
    left = _mirrored(right)
    count, size = len(right.names), len(right.vertices)
    names = ("chest", *(f"right{name}" for name in right.names), *(f"left{name}" for name in left.names))
    parents = (-1, *(p + 1 for p in right.parents), *(p + 1 + count if p >= 0 else 0 for p in left.parents))
    return SkinnedMesh(
        vertices=np.concatenate([right.vertices, left.vertices]),
        normals=np.concatenate([right.normals, left.normals]),
        triangles=np.concatenate([right.triangles, left.triangles + np.uint32(size)]),
        colours=np.concatenate([right.colours, left.colours]),
        names=names,
        parents=parents,
        joints=np.concatenate([np.zeros((1, 3)), right.joints, left.joints]),
        bones=np.concatenate([right.bones + 1, np.where(left.weights > 0.0, left.bones + 1 + count, 0)]),
        weights=np.concatenate([right.weights, left.weights]),
    )


def _straight_arm() -> SkinnedMesh:
    """The right arm in ISB axes, hanging, palm to the front."""
    vertices, normals, triangles = _surface()
    joints = np.array([[0.0, 0.0, 0.0], [0.0, -UPPER_ARM_M, 0.0], [0.0, WRIST_Y, 0.0]])
    knuckles = np.array(list(_KNUCKLES.values())) + joints[2]
    y = vertices[:, 1]
    below_elbow = _smooth((joints[1, 1] - y) / ELBOW_BLEND_M)
    below_wrist = _smooth((joints[2, 1] - y) / WRIST_BLEND_M)
    bones, weights = pack_weights(
        np.tile([0, 1, 2], (len(y), 1)),
        np.stack([1.0 - below_elbow, below_elbow * (1.0 - below_wrist), below_elbow * below_wrist], axis=-1),
        3,
    )
    return SkinnedMesh(
        vertices=vertices,
        normals=normals,
        triangles=triangles.astype(np.uint32),
        colours=np.tile(np.array(SKIN_COLOUR, np.uint8), (len(y), 1)),
        names=(*BONES, *_KNUCKLES),
        parents=(-1, 0, 1, 2, 2),
        joints=np.concatenate([joints, knuckles]),
        bones=bones,
        weights=weights,
    )


def _surface() -> tuple[Floats, Floats, Integers]:
    """Vertices, normals and triangles: rings from the shoulder to just above the wrist, a net from there on."""
    rim_y = WRIST_Y + SEAM_M
    bend = -UPPER_ARM_M + ELBOW_BLEND_M, -UPPER_ARM_M - ELBOW_BLEND_M
    heights = np.concatenate(
        [
            np.arange(TOP_M, bend[0], -RING_M),
            np.arange(bend[0], bend[1], -0.5 * RING_M),  # where the elbow bends
            np.arange(bend[1], rim_y + 0.8 * RING_M, -RING_M),
        ]
    )
    middle = limb(heights)[:, 2:]
    centres = np.stack([middle[:, 0], heights, middle[:, 1]], axis=-1)
    tube, tube_triangles = rings(distance, centres, WIDEST_M, AROUND)
    lower = np.array([-0.040, WRIST_Y - 0.175, -0.062])
    net, net_triangles = surface_net(distance, lower, np.array([0.095, rim_y, 0.075]), NET_M)
    net, net_triangles = _without_strays(net, net_triangles)
    vertices = np.concatenate([tube, net])
    rim = open_edge(net, net_triangles) + len(tube)
    last = np.arange(len(tube) - AROUND, len(tube))
    cap = np.stack([np.zeros(AROUND - 2, np.int64), np.arange(2, AROUND), np.arange(1, AROUND - 1)], axis=-1)
    triangles = np.concatenate([cap, tube_triangles, net_triangles + len(tube), zip_up(vertices, last, rim)])
    normals = vertex_normals(vertices, triangles.astype(np.uint32))
    normals[len(tube) :] = gradient(distance, net)
    return vertices, normals, triangles


def _without_strays(vertices: Floats, triangles: Integers) -> tuple[Floats, Integers]:
    """Drop vertices that no triangle uses."""
    used, compact = np.unique(triangles, return_inverse=True)
    return vertices[used], compact.reshape(-1, 3)


def _at_rest(arm: SkinnedMesh) -> SkinnedMesh:
    """Pronate the straight arm to the middle of its range, then raise it to the A-pose and put it on the shoulder."""
    spread, segments = split(arm, 1, arm.joints[2], 24)
    turn = PRONATED * segments.shares
    motions = np.tile([0.0, 0, 0, 0, 0, 0, 1.0], (len(spread.names), 1))
    motions[segments.bones, 4], motions[segments.bones, 6] = np.sin(0.5 * turn), np.cos(0.5 * turn)
    motions[2:5] = motions[segments.bones[-1]]
    vertices, normals = skin(spread, motions)
    pronated = np.array([0.0, np.sin(0.5 * PRONATED), 0.0, np.cos(0.5 * PRONATED)])
    joints = arm.joints.copy()
    joints[3:] = batch.rotate(pronated, joints[3:])

    # ISB axes to OpenXR's, then up about the axis to the front
    shoulder_from_isb = np.array([0.0, np.sin(np.pi / 4), 0.0, np.cos(np.pi / 4)])
    lift = np.array([0.0, 0.0, np.sin(0.5 * RAISED), np.cos(0.5 * RAISED)])
    rotation = batch.multiply(lift, shoulder_from_isb)
    place = np.array([HALF_SHOULDER_WIDTH_M, 0.0, 0.0])
    return replace(
        arm,
        vertices=batch.rotate(rotation, vertices) + place,
        normals=batch.rotate(rotation, normals),
        joints=batch.rotate(rotation, joints) + place,
    )


def _mirrored(arm: SkinnedMesh) -> SkinnedMesh:
    other = np.array([-1.0, 1.0, 1.0])
    return replace(
        arm,
        vertices=arm.vertices * other,
        normals=arm.normals * other,
        joints=arm.joints * other,
        triangles=np.ascontiguousarray(arm.triangles[:, ::-1]),
    )


def _smooth(x: Floats) -> Floats:
    """0 below -1, 1 above 1, smooth between."""
    t = np.clip(0.5 * (x + 1.0), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))
