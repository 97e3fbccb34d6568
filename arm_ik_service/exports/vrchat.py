"""VRChat's OSC trackers: world positions [m] and Euler angles [deg] in Unity's axes and order, usually port 9000.

The elbows are upper-arm trackers: 1 the left, 2 the right one, placed at the elbow, turning with the upper arm. `head`
lets VRChat line up its space with ours. VRChat finds out which tracker is which when it calibrates, in a T-pose.
Specification: docs.vrchat.com, OSC Trackers.
"""

from __future__ import annotations

from arm_ik_service.exports.axes import UNITY, unity_euler_deg
from arm_ik_service.exports.osc import Message
from arm_ik_service.exports.posture import Joint, posture_of
from arm_ik_service.wire.messages import ArmsState

LEFT_ELBOW, RIGHT_ELBOW, CHEST = "1", "2", "3"


def messages(state: ArmsState, *, chest: bool = False) -> list[Message]:
    """Return one state as tracker messages; `chest` adds tracker 3, our estimate of the chest."""
    posture = posture_of(state)
    trackers = [
        ("head", posture.head),
        (LEFT_ELBOW, Joint(posture.left.lower_arm.position, posture.left.upper_arm.rotation)),
        (RIGHT_ELBOW, Joint(posture.right.lower_arm.position, posture.right.upper_arm.rotation)),
    ]
    if chest:
        trackers.append((CHEST, posture.chest))
    out: list[Message] = []
    for name, joint in trackers:
        out.append((f"/tracking/trackers/{name}/position", UNITY.vector(joint.position)))
        out.append((f"/tracking/trackers/{name}/rotation", unity_euler_deg(UNITY.rotation(joint.rotation))))
    return out
