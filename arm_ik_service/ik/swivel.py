"""The arm in closed form at a given elbow swivel, and how comfortable it would be there.

With the carrying angle and the wrist's axial play at zero the arm has seven joints, so hand pose and swivel fix it: the
elbow lies on a circle around the line from shoulder to wrist, the hand's rotation splits into pronation, wrist
flexion and deviation (Tolani, Goswami & Badler 2000). The loop in `conjugate` does the solving; this says where the
elbow should go, and gives it a start where it has none or is stuck.

Swivel is the angle [rad] of the elbow around the line from shoulder to wrist, 0 where the elbow hangs lowest. It is
read off the plane of the arm rather than off the elbow, so a straight arm has one too.
"""

from __future__ import annotations

import math
from typing import Any

from arm_ik_service.arm.chain import Columns, columns_of, turn
from arm_ik_service.arm.limits import clamp_swing, clamp_twist, swing_excess, twist_excess, twist_of
from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry.scalar import Vector, clip, cross, dot, from_columns, norm, scale, subtract

NEARLY_STRAIGHT = 0.1  # sine of the angle between upper arm and line of reach below which the elbow says no swivel

Reach = tuple[Columns, float, float, float]  # line to the wrist with two normals, elbow along and off it, flexion
Posture = tuple[Columns, float, float, float, float]  # upper arm; elbow flexion, pronation, wrist flexion, deviation


@compiled
def reach_to(chain: Record, position: Vector) -> Reach:
    """What all swivels of a wrist position share."""
    upper, lower = chain.upper_arm_m, chain.forearm_m
    wanted = norm(position)
    axis = scale(1.0 / wanted, position) if wanted > 1e-9 else (0.0, -1.0, 0.0)
    # the lowest direction around the axis, or the rearmost where the axis itself is upright
    down = (0.0, -1.0, 0.0) if abs(axis[1]) < 0.95 else (-1.0, 0.0, 0.0)
    low = subtract(down, scale(dot(down, axis), axis))
    low = scale(1.0 / norm(low), low)
    distance = clip(wanted, abs(upper - lower) + 1e-6, upper + lower)
    along = (upper * upper + distance * distance - lower * lower) / (2.0 * distance)
    off = math.sqrt(max(0.0, upper * upper - along * along))
    bend = (distance * distance - upper * upper - lower * lower) / (2.0 * upper * lower)
    return (axis, low, cross(axis, low)), along / upper, off / upper, math.acos(clip(bend, -1.0, 1.0))


@compiled
def swivel_of(reach: Reach, upper_arm: Columns) -> float:
    """Swivel of an upper arm about the line of `reach`."""
    return math.atan2(dot(upper_arm[2], reach[0][1]), -dot(upper_arm[2], reach[0][2]))


@compiled
def elbow_swivel(reach: Reach, upper_arm: Columns) -> float:
    """Swivel of the elbow itself, which a carrying angle takes out of the arm's plane; if straight, the plane's."""
    out, aside = -dot(upper_arm[1], reach[0][1]), -dot(upper_arm[1], reach[0][2])
    if out * out + aside * aside < NEARLY_STRAIGHT * NEARLY_STRAIGHT:
        return swivel_of(reach, upper_arm)
    return math.atan2(aside, out)


@compiled
def posture_at(reach: Reach, rotation: Columns, swivel: float) -> Posture:
    """The arm whose wrist is where `reach` says and whose hand bone has `rotation`; angles not held to any range."""
    (axis, low, side), along, off, flexion = reach
    c, s = math.cos(swivel), math.sin(swivel)
    out = (c * low[0] + s * side[0], c * low[1] + s * side[1], c * low[2] + s * side[2])
    y = (-along * axis[0] - off * out[0], -along * axis[1] - off * out[1], -along * axis[2] - off * out[2])
    z = cross(out, axis)
    x = cross(y, z)
    fx, fy = turn(x, y, flexion)
    tx, ty, tz = rotation
    sine = clip(dot(fy, tx), -1.0, 1.0)
    pronation = math.atan2(-dot(z, tx), dot(fx, tx))
    if pronation < -0.5 * math.pi:
        pronation += 2.0 * math.pi
    return (x, y, z), flexion, pronation, math.asin(sine), math.atan2(-dot(fy, tz), dot(fy, ty))


@compiled
def beyond(angle: float, lower: float, upper: float) -> float:
    """Squared distance of an angle from a range [rad^2]."""
    d = max(lower - angle, 0.0, angle - upper)
    return d * d


@compiled
def violation(chain: Record, posture: Posture, margin: float) -> float:
    """Sum of squared excesses [rad^2] over limits drawn in by `margin` [rad]; 0: the arm can take this posture.

    What the wrist's axial play and the carrying angle can make up for counts as excess too.
    """
    upper_arm, flexion, pronation, wrist_flexion, deviation = posture
    lower, upper = chain.lower, chain.upper
    total = beyond(flexion, lower[0], upper[0])
    total += beyond(pronation, lower[2] + margin, upper[2] - margin)
    total += beyond(wrist_flexion, lower[3] + margin, upper[3] - margin)
    total += beyond(deviation, lower[4] + margin, upper[4] - margin)
    swing = swing_excess(chain, scale(-1.0, upper_arm[1])) + margin
    if swing > 0.0:
        total += swing * swing
    twist, height = twist_of(upper_arm), -upper_arm[1][1]
    ahead = max(twist_excess(chain, twist + margin, height), 0.0) + min(
        twist_excess(chain, twist - margin, height), 0.0
    )
    return total + ahead * ahead


@compiled
def take(chain: Record, posture: Posture, configuration: Any) -> None:
    """Write a posture into a configuration (10,), brought inside all limits."""
    upper_arm, flexion, pronation, wrist_flexion, deviation = posture
    q = clamp_swing(chain, from_columns(*upper_arm), upper_arm)
    q = clamp_twist(chain, q, columns_of(q))
    for i in range(4):
        configuration[i] = q[i]
    configuration[4] = clip(flexion, chain.lower[0], chain.upper[0])
    configuration[5] = clip(0.0, chain.lower[1], chain.upper[1])
    configuration[6] = clip(pronation, chain.lower[2], chain.upper[2])
    configuration[7] = clip(wrist_flexion, chain.lower[3], chain.upper[3])
    configuration[8] = clip(deviation, chain.lower[4], chain.upper[4])
    configuration[9] = clip(0.0, chain.lower[5], chain.upper[5])
