"""One device in time: follow what is good, coast and hold where nothing is, come back at a bounded speed.

Position and rotation go their own ways: a controller that the cameras lost still knows how it is turned.
"""

from __future__ import annotations

import math

from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.scalar import Quaternion, Vector
from arm_ik_service.tracking.glitch import agreeing_moves, gate_interval_s, human_move, human_turn, suspect
from arm_ik_service.tracking.reacquire import fading_offset, start_fading
from arm_ik_service.tracking.smoothing import note_position, note_rotation, restart, smooth_position, smooth_rotation
from arm_ik_service.tracking.state import HELD, INFERRED, LOST, NEVER_S
from arm_ik_service.tracking.validity import position_quality, rotation_quality

FOLLOW = 1  # of TrackingSettings.dead_reckoning
COASTS_FOR_S = 0.025  # time constant: a hand that is lost sight of in a stroke does not stop at once
VELOCITY_TIME_S = 0.01  # of the published velocities' low pass
LONGEST_STEP_S = 0.1  # for the filters; after a longer gap they follow at once anyway


@compiled
def _source(quality: int, settings: Record) -> int:
    """What to follow of a sample of this quality: LOST for nothing."""
    return LOST if quality == INFERRED and settings.dead_reckoning != FOLLOW else quality


@compiled
def _state(source: int, followed: bool, age_s: float, settings: Record) -> int:
    if followed:
        return source
    return LOST if age_s > settings.lost_after_s else HELD


@compiled
def _continued(before: Quaternion, after: Quaternion) -> Quaternion:
    """Return `after` with the sign that makes it the nearer neighbour of `before`."""
    inner = before[0] * after[0] + before[1] * after[1] + before[2] * after[2] + before[3] * after[3]
    return after if inner >= 0.0 else (-after[0], -after[1], -after[2], -after[3])


@compiled
def _low_pass(velocity: Vector, sample: Vector, dt_s: float) -> Vector:
    return g.lerp(velocity, sample, 1.0 - math.exp(-dt_s / VELOCITY_TIME_S))


@compiled
def _left_of(velocity: Vector, state: int) -> Vector:
    """Velocity that a hand in this state goes on with when no data comes."""
    return velocity if state != LOST else (0.0, 0.0, 0.0)


@compiled
def _coasted(velocity: Vector, dt_s: float) -> Vector:
    """Way [m or rad] that is still made in `dt_s` without data."""
    return g.scale(COASTS_FOR_S * (1.0 - math.exp(-dt_s / COASTS_FOR_S)), velocity)


@compiled
def _follow_position(
    device: Record, position: Vector, source: int, elapsed_s: float, period_s: float, settings: Record
) -> bool:
    """Bring the memory up to this sample unless it is a glitch; whether it was followed."""
    channel = device.position_channel
    since_s = device.position_age_s + elapsed_s
    gate_s = gate_interval_s(elapsed_s, period_s)
    if channel.source == source and not human_move(channel, position, device.position_age_s, gate_s):
        device.glitches += 1
        if not suspect(channel, position, agreeing_moves(channel, position, gate_s), elapsed_s):
            return False
    if channel.source != source or channel.suspects > 0:
        expected = g.add(g.vector(device.position), _coasted(g.vector(device.linear_velocity), elapsed_s))
        offset = g.subtract(expected, position) if device.position_age_s < NEVER_S else (0.0, 0.0, 0.0)
        start_fading(channel, offset, settings.reacquire_m_s)
        restart(channel, position)
    else:
        note_position(channel, position, since_s, min(since_s, LONGEST_STEP_S), settings.smoothing)
    channel.source, channel.suspects = source, 0
    return True


@compiled
def _place(device: Record, source: int, followed: bool, gain: float, elapsed_s: float, settings: Record) -> None:
    """Say where the device is, by its memory."""
    channel, before, velocity = device.position_channel, g.vector(device.position), g.vector(device.linear_velocity)
    if followed:
        after = g.add(smooth_position(channel, gain), fading_offset(channel, elapsed_s))
        known = device.position_age_s < NEVER_S
        rate = g.scale(1.0 / elapsed_s if known else 0.0, g.subtract(after, before))
        g.store(device.linear_velocity, _low_pass(velocity, rate, elapsed_s))
        device.position_age_s = 0.0
    else:
        device.position_age_s = min(device.position_age_s + elapsed_s, NEVER_S)
        velocity = _left_of(velocity, device.position_state)
        after = g.add(before, _coasted(velocity, elapsed_s))
        g.store(device.linear_velocity, g.scale(math.exp(-elapsed_s / COASTS_FOR_S), velocity))
        channel.source = channel.source if source != LOST else LOST
    g.store(device.position, after)
    device.position_state = _state(source, followed, device.position_age_s, settings)


@compiled
def _follow_rotation(
    device: Record, rotation: Quaternion, source: int, elapsed_s: float, period_s: float, settings: Record
) -> bool:
    """The same for the rotation."""
    channel, last = device.rotation_channel, g.quaternion(device.rotation_channel.measured)
    since_s = device.rotation_age_s + elapsed_s
    gate_s = gate_interval_s(elapsed_s, period_s)
    if channel.source == source and not human_turn(last, rotation, gate_s):
        device.glitches += 1
        if not suspect(channel, rotation, human_turn(g.quaternion(channel.suspect), rotation, gate_s), elapsed_s):
            return False
    if channel.source != source or channel.suspects > 0:
        turn = g.exp(_coasted(g.vector(device.angular_velocity), elapsed_s))
        expected = g.multiply(turn, g.quaternion(device.rotation))
        offset = g.log(g.multiply(expected, g.conjugate(rotation)))
        known = device.rotation_age_s < NEVER_S
        start_fading(channel, offset if known else (0.0, 0.0, 0.0), settings.reacquire_rad_s)
        restart(channel, rotation)
    else:
        note_rotation(channel, rotation, since_s, min(since_s, LONGEST_STEP_S), settings.smoothing)
    channel.source, channel.suspects = source, 0
    return True


@compiled
def _turn(device: Record, source: int, followed: bool, gain: float, elapsed_s: float, settings: Record) -> None:
    """Say how it is turned."""
    channel, before, velocity = (
        device.rotation_channel,
        g.quaternion(device.rotation),
        g.vector(device.angular_velocity),
    )
    if followed:
        after = g.multiply(g.exp(fading_offset(channel, elapsed_s)), smooth_rotation(channel, gain))
        known = device.rotation_age_s < NEVER_S
        rate = g.scale(1.0 / elapsed_s if known else 0.0, g.log(g.multiply(after, g.conjugate(before))))
        g.store(device.angular_velocity, _low_pass(velocity, rate, elapsed_s))
        device.rotation_age_s = 0.0
    else:
        device.rotation_age_s = min(device.rotation_age_s + elapsed_s, NEVER_S)
        velocity = _left_of(velocity, device.rotation_state)
        after = g.multiply(g.exp(_coasted(velocity, elapsed_s)), before)
        g.store(device.angular_velocity, g.scale(math.exp(-elapsed_s / COASTS_FOR_S), velocity))
        channel.source = channel.source if source != LOST else LOST
    g.store(device.rotation, _continued(before, g.normalized(after)))
    device.rotation_state = _state(source, followed, device.rotation_age_s, settings)


@compiled
def step_device(device: Record, sample: Record, elapsed_s: float, period_s: float, settings: Record) -> None:
    """Take in one sample, `elapsed_s` after the last one, of a sender whose frames are `period_s` apart."""
    place, turn = device.position_channel, device.rotation_channel
    place.gain = turn.gain = 0.0
    place_source = _source(position_quality(sample), settings)
    placed = place_source != LOST and _follow_position(
        device, g.vector(sample.position), place_source, elapsed_s, period_s, settings
    )
    turn_source = _source(rotation_quality(sample), settings)
    turned = turn_source != LOST and _follow_rotation(
        device, g.normalized(g.quaternion(sample.rotation)), turn_source, elapsed_s, period_s, settings
    )
    gain = max(place.gain, turn.gain)  # one for both: what is rigid stays rigid
    _place(device, place_source, placed, gain, elapsed_s, settings)
    _turn(device, turn_source, turned, gain, elapsed_s, settings)
