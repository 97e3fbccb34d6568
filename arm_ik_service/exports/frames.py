"""The bones as a tree of frames, as ROS's tf and Foxglove draw them.

Axes are REP-103's (x forward, y left, z up). The tree is `world` -> chest -> head, and chest -> clavicle -> upper_arm
-> forearm -> hand on each side, named `avatar_<id>/right_forearm` and so on; in a T-pose all are parallel to `world`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

from arm_ik_service.exports.axes import ROS
from arm_ik_service.exports.posture import Joint, in_parent, posture_of
from arm_ik_service.geometry.scalar import Quaternion, Vector
from arm_ik_service.wire.messages import ArmsState

WORLD = "world"
BONES = ("clavicle", "upper_arm", "forearm", "hand")


class Frame(NamedTuple):
    """A frame in its parent, in ROS axes."""

    parent: str
    child: str
    position: Vector
    rotation: Quaternion


def ros_name(avatar: str) -> str:
    """Return the avatar's name as ROS allows one: letters, digits, `_`, and no digit first."""
    return "avatar_" + re.sub(r"[^A-Za-z0-9_]", "_", avatar)


def frames_of(state: ArmsState) -> Iterator[Frame]:
    """Give every frame of one state, parents first."""
    posture = posture_of(state)
    prefix = ros_name(state.avatar)
    chest = f"{prefix}/chest"
    yield _frame(WORLD, chest, posture.chest)
    yield _frame(chest, f"{prefix}/head", in_parent(posture.chest, posture.head))
    for side, arm in posture.arms():
        parent_name, parent = chest, posture.chest
        for name, joint in zip(BONES, arm, strict=True):
            child = f"{prefix}/{side}_{name}"
            yield _frame(parent_name, child, in_parent(parent, joint))
            parent_name, parent = child, joint


def _frame(parent: str, child: str, joint: Joint) -> Frame:
    return Frame(parent, child, ROS.vector(joint.position), ROS.rotation(joint.rotation))
