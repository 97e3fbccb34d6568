"""The stage of the solve: a target record in, one ARM record moved on by a frame, with velocity, angles and bones."""

from __future__ import annotations

from typing import Any

from arm_ik_service.arm import tangent
from arm_ik_service.arm.angles import isb_shoulder, joint_angles
from arm_ik_service.arm.chain import (
    bone_from_arm,
    columns_of,
    forward,
    hand_from_arm,
    hand_to_arm,
    position_from_arm,
    position_to_arm,
    spin_to_arm,
)
from arm_ik_service.arm.configuration import difference, integrate, read_configuration, store_configuration
from arm_ik_service.arm.limits import swing_excess, swing_surely_inside, twist_excess, twist_of
from arm_ik_service.compiled import Record, compiled, inlined
from arm_ik_service.geometry.scalar import clip, quaternion, scale, store, vector
from arm_ik_service.ik.calm import calm
from arm_ik_service.ik.conjugate import SOLVED
from arm_ik_service.ik.frame_step import first_frame, step_frame
from arm_ik_service.ik.relief import relief
from arm_ik_service.ik.state import ARM, initialise_arm
from arm_ik_service.ik.velocity import ITERATIONS, SPEED_BIT, velocity_from_twist

RESTS_RAD = 1e-3  # nearer to a limit than this the arm rests on it, for whoever reads the mask
MAX_AHEAD_S = 0.1  # a constant joint velocity says nothing about later
MET_FRAMES = 3  # on end that a hand at a limit must be met before its twist is believed to be that of the arm
MIN_DT_S, MAX_DT_S = 1e-3, 0.1  # a frame's time outside this says nothing about speed


@compiled
def step_arm(arm: Record, target: Record, dt_s: float, settings: Record) -> None:
    """Move one arm on to a TARGET (position, rotation and velocities in the shoulder frame).

    `dt_s` is the time since the last frame. Never fails: what cannot be met is met as nearly as can be.
    """
    chain = arm.chain
    dt_s = clip(dt_s, MIN_DT_S, MAX_DT_S)
    position = position_to_arm(chain, vector(target.position))
    rotation = columns_of(hand_to_arm(chain, quaternion(target.rotation)))
    store(arm.carried, vector(target.carried_linear_velocity))
    store(arm.carried_spin, vector(target.carried_angular_velocity))
    for i in range(10):
        arm.before[i] = arm.shown[i]
    if arm.started == 0:
        first_frame(arm, settings, position, rotation)
    else:
        step_frame(arm, settings, position, rotation, dt_s)
    calm(arm, settings, position, rotation, dt_s)
    _keep_sign(arm)
    store(arm.relief, relief(arm))
    linear = position_to_arm(chain, vector(target.linear_velocity))
    angular = spin_to_arm(chain, vector(target.angular_velocity))
    _move_on(arm, settings, linear, angular, dt_s)
    for i in range(10):
        arm.published[i] = arm.shown[i]
    _show(arm)
    found = quaternion(arm.hand_rotation)
    if arm.orientation_error_rad != arm.work.orientation_error_rad:  # turned less than it was solved
        found = hand_from_arm(chain, forward(chain, arm.configuration)[4])
    store(arm.hand_found, found)


@inlined
def _keep_sign(arm: Record) -> None:
    """A quaternion and its negative are one rotation; whoever blends from frame to frame minds which it is."""
    q, before = arm.shown, arm.before
    if q[0] * before[0] + q[1] * before[1] + q[2] * before[2] + q[3] * before[3] < 0.0:
        for i in range(4):
            q[i] = -q[i]


@compiled
def show_ahead(arm: Record, ahead_s: float) -> None:
    """Let what is read off the arm be as it will be in `ahead_s`, at most MAX_AHEAD_S; the arm itself stays."""
    predict(arm, clip(ahead_s, 0.0, MAX_AHEAD_S), arm.published)
    _show(arm)


@compiled
def _move_on(arm: Record, settings: Record, linear: Any, angular: Any, dt_s: float) -> None:
    """Find the joint velocity: recent motion carried on, corrected by the hand's twist, scaled to speed limits."""
    chain, q = arm.chain, read_configuration(arm.shown)
    # A hand that limits hold back does not move as it is asked to, nor does an arm that comes upon one or leaves it.
    limits = limits_at(chain, arm.shown)
    met = arm.status == SOLVED and limits == arm.limits & ~SPEED_BIT
    follows = met and (limits == 0 or arm.started > MET_FRAMES)
    onward = tangent.STILL
    if arm.started == 0 or (arm.restarted == 1 and settings.elbow_lag_m == 0.0):  # a jump is no motion
        arm.started = 1
        tangent.store(arm.recent_velocity, tangent.STILL)
    else:
        recent = tangent.scale(1.0 / dt_s, difference(read_configuration(arm.before), q))
        # The mean over the last frame is half a frame old: carry it on. Where limits meddle, calm it.
        change = tangent.subtract(recent, tangent.read(arm.recent_velocity))
        share = (0.5 if arm.started > 1 else 0.0) if follows else -0.5
        onward = tangent.add(recent, tangent.scale(share, change))
        tangent.store(arm.recent_velocity, recent)
        arm.started = min(arm.started, MET_FRAMES) + 1 if met else 1
    lam = settings.rotation_weight_m * settings.rotation_weight_m
    velocity, _ = velocity_from_twist(chain, q, onward, linear, angular, lam, ITERATIONS if follows else 0)
    share = 1.0
    rates, most = arm.velocity, chain.speed_limit
    tangent.store(rates, velocity)
    for i in range(9):
        share = min(share, most[i] / max(abs(rates[i]), 1e-9))
    for i in range(9):
        rates[i] *= share
    arm.limits = limits | (SPEED_BIT if share < 1.0 else 0)


@compiled
def limits_at(chain: Record, configuration: Any) -> int:
    """Bit mask over arm.model.LIMITS of the limits that a configuration (10,) rests on."""
    bone = columns_of((configuration[0], configuration[1], configuration[2], configuration[3]))
    twist, height = twist_of(bone), -bone[1][1]
    inside = swing_surely_inside(chain, bone)
    mask = 1 if not inside and swing_excess(chain, scale(-1.0, bone[1])) > -RESTS_RAD else 0
    if twist_excess(chain, twist + RESTS_RAD, height) > 0.0 or twist_excess(chain, twist - RESTS_RAD, height) < 0.0:
        mask |= 2
    for i in range(6):
        angle = configuration[4 + i]
        if angle <= chain.lower[i] + RESTS_RAD or angle >= chain.upper[i] - RESTS_RAD:
            mask |= 4 << i
    return mask


@compiled
def _show(arm: Record) -> None:
    """Fill what is read off the published configuration."""
    chain, work = arm.chain, arm.work
    elbow, wrist, upper, lower, hand = forward(chain, arm.published)
    store(arm.elbow, position_from_arm(chain, elbow))
    store(arm.wrist, position_from_arm(chain, wrist))
    store(arm.upper_arm_rotation, bone_from_arm(chain, upper))
    store(arm.forearm_rotation, bone_from_arm(chain, lower))
    store(arm.hand_rotation, hand_from_arm(chain, hand))
    joint_angles(arm.published, arm.velocity, arm.angles, arm.angle_rates)
    arm.isb_singular = isb_shoulder(arm.published, arm.isb)
    arm.iterations = work.iterations


@compiled
def predict(arm: Record, ahead_s: float, configuration: Any) -> None:
    """Write the configuration (10,) that the arm's velocity leads to in `ahead_s`, inside the limits."""
    motion = tangent.scale(ahead_s, tangent.read(arm.velocity))
    store_configuration(configuration, integrate(arm.chain, read_configuration(arm.shown), motion))


__all__ = ["ARM", "initialise_arm", "limits_at", "predict", "show_ahead", "step_arm"]
