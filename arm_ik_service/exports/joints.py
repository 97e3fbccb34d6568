"""The nine joint angles a side by the names robotics tools see: `left_` or `right_` and the field of JointAngles."""

from __future__ import annotations

from arm_ik_service.wire.messages import SIDES, ArmsState, JointAngles

ANGLE_NAMES: tuple[str, ...] = JointAngles.__struct_fields__
JOINT_NAMES: tuple[str, ...] = tuple(f"{side}_{name}" for side in SIDES for name in ANGLE_NAMES)


def values_of(angles: JointAngles) -> list[float]:
    """Return the nine numbers in order."""
    return [getattr(angles, name) for name in ANGLE_NAMES]


def positions_of(state: ArmsState) -> list[float]:
    """Return the angles (18,) [rad] in the order of JOINT_NAMES."""
    return values_of(state.left.angles) + values_of(state.right.angles)


def velocities_of(state: ArmsState) -> list[float]:
    """Return the rates (18,) [rad/s] in the order of JOINT_NAMES."""
    return values_of(state.left.angle_rates) + values_of(state.right.angle_rates)
