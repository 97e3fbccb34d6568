"""Recentring: the tracked space is moved under the devices, and all of them jump by one rigid motion together."""

from __future__ import annotations

from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.scalar import Quaternion, Vector
from arm_ik_service.tracking.glitch import PREDICTS_FOR_S
from arm_ik_service.tracking.state import TRACKED
from arm_ik_service.tracking.validity import position_quality, rotation_quality

# What a head does not do (dancers reach 4.8 m/s; 15 rad/s but for a shake). Where it does all the same and the hands
# turn with it, the answer is right as well: the person spins.
HEAD_FASTEST_M_S, HEAD_FASTEST_RAD_S = 5.0, 15.0
HEAD_NOISE_M, HEAD_NOISE_RAD = 0.02, 0.05
HANDS_AGREE_M, HANDS_AGREE_M_S = 0.05, 3.0  # how well the hands must fit the motion of the head ...
HANDS_AGREE_PART = 0.5  # ... and by which part of their own jump


@compiled
def _predicted(device: Record, elapsed_s: float) -> Vector:
    channel = device.position_channel
    return g.add(g.vector(channel.measured), g.scale(min(elapsed_s, PREDICTS_FOR_S), g.vector(channel.rate)))


@compiled
def _is_followed(device: Record, sample: Record) -> bool:
    return bool(device.position_channel.source == TRACKED and position_quality(sample) == TRACKED)


@compiled
def _hands_agree(tracking: Record, frame: Record, old: Vector, new: Vector, turn: Quaternion, elapsed_s: float) -> bool:
    agreeing = 0
    for k in range(2):
        if _is_followed(tracking.hands[k], frame.hands[k]):
            before = _predicted(tracking.hands[k], elapsed_s)
            expected = g.add(new, g.rotate(turn, g.subtract(before, old)))
            off = g.norm(g.subtract(g.vector(frame.hands[k].position), expected))
            jump = g.norm(g.subtract(expected, before))
            if off > min(HANDS_AGREE_M + HANDS_AGREE_M_S * elapsed_s, HANDS_AGREE_PART * jump):
                return False
            agreeing += 1
    return agreeing > 0


@compiled
def _move_device(device: Record, old: Vector, new: Vector, turn: Quaternion) -> None:
    place, spin = device.position_channel, device.rotation_channel
    for position in (device.position, place.measured, place.suspect, place.smooth):
        g.store(position, g.add(new, g.rotate(turn, g.subtract(g.vector(position), old))))
    for rotation in (device.rotation, spin.measured, spin.suspect, spin.smooth):
        g.store(rotation, g.normalized(g.multiply(turn, g.quaternion(rotation))))
    for tangent in (device.linear_velocity, device.angular_velocity, place.rate, place.slope, place.offset):
        g.store(tangent, g.rotate(turn, g.vector(tangent)))
    for tangent in (spin.rate, spin.slope, spin.offset):
        g.store(tangent, g.rotate(turn, g.vector(tangent)))


@compiled
def follow_recentre(tracking: Record, frame: Record, elapsed_s: float) -> None:
    """Where this frame is a recentre, move all memory along; sets `recentred_yaw` [rad] about +Y, else 0."""
    tracking.recentred_yaw = 0.0
    head = tracking.head
    known = head.rotation_channel.source == TRACKED and rotation_quality(frame.head) == TRACKED
    if not known or not _is_followed(head, frame.head):
        return
    old, new = _predicted(head, elapsed_s), g.vector(frame.head.position)
    last = g.quaternion(head.rotation_channel.measured)
    yaw = g.twist_y(g.multiply(g.normalized(g.quaternion(frame.head.rotation)), g.conjugate(last)))
    far = g.norm(g.subtract(new, old)) > HEAD_FASTEST_M_S * elapsed_s + HEAD_NOISE_M
    turned = abs(yaw) > HEAD_FASTEST_RAD_S * elapsed_s + HEAD_NOISE_RAD
    turn = g.rotation_y(yaw)
    if (far or turned) and _hands_agree(tracking, frame, old, new, turn, elapsed_s):
        _move_device(head, old, new, turn)
        for k in range(2):
            _move_device(tracking.hands[k], old, new, turn)
        tracking.recentres += 1
        tracking.recentred_yaw = yaw
        g.store(tracking.recentred_from, old)
        g.store(tracking.recentred_to, new)
