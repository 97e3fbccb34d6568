"""One state as a tree of joints: what every dialect is made from.

A joint's rotation is the one since the T-pose of `axes.py`, in OpenXR world axes; in a T-pose all are the identity.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from arm_ik_service.exports.axes import since_t_pose, untwisted
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.scalar import Quaternion, Vector
from arm_ik_service.wire.messages import SIDES, ArmsState, ArmState, Pose, Side


class Joint(NamedTuple):
    """Where a joint is [m] and how far its bone has turned since the T-pose; in world axes, or in its parent's."""

    position: Vector
    rotation: Quaternion


class ArmPosture(NamedTuple):
    """One arm, from the sternoclavicular joint to the wrist."""

    clavicle: Joint
    upper_arm: Joint
    lower_arm: Joint
    hand: Joint


class Posture(NamedTuple):
    """The person, in world axes. The chest's position is midway between the shoulders at rest."""

    chest: Joint
    head: Joint
    left: ArmPosture
    right: ArmPosture

    def arms(self) -> Iterator[tuple[Side, ArmPosture]]:
        """Give both arms with their names."""
        return zip(SIDES, (self.left, self.right), strict=True)


def posture_of(state: ArmsState, lower_arm_twist: float = 1.0) -> Posture:
    """Read a state. `lower_arm_twist` is the share of the pronation that the lower arm shows; the hand has it all."""
    return Posture(
        _as_it_is(state.chest),
        _as_it_is(state.head),
        _arm("left", state.left, lower_arm_twist),
        _arm("right", state.right, lower_arm_twist),
    )


def in_parent(parent: Joint, child: Joint) -> Joint:
    """Give a joint in the axes of its parent."""
    parent_from_world = g.conjugate(parent.rotation)
    return Joint(
        g.rotate(parent_from_world, g.subtract(child.position, parent.position)),
        g.multiply(parent_from_world, child.rotation),
    )


def _as_it_is(pose: Pose) -> Joint:
    return Joint(pose.position, pose.orientation)


def _arm(side: Side, arm: ArmState, lower_arm_twist: float) -> ArmPosture:
    bones = arm.bones
    forearm = bones.forearm.orientation
    if lower_arm_twist != 1.0:
        forearm = untwisted(side, forearm, arm.angles.pronation, lower_arm_twist)
    return ArmPosture(
        Joint(bones.clavicle.position, since_t_pose(side, "clavicle", bones.clavicle.orientation)),
        Joint(bones.upper_arm.position, since_t_pose(side, "upper_arm", bones.upper_arm.orientation)),
        Joint(bones.forearm.position, since_t_pose(side, "forearm", forearm)),
        Joint(bones.hand.position, since_t_pose(side, "hand", bones.hand.orientation)),
    )
