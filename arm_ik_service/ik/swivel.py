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

from arm_ik_service.arm.chain import Columns
from arm_ik_service.arm.limits import clamp_shoulder, swing_excess, swing_surely_inside, twist_beyond, twist_of
from arm_ik_service.compiled import Record, compiled, inlined
from arm_ik_service.geometry.scalar import Vector, add, clip, cross, dot, from_columns, norm, scale, subtract
from arm_ik_service.geometry.trigonometry import angle_of, sine_cosine

NEARLY_STRAIGHT = 0.1  # sine of the angle between upper arm and line of reach below which the elbow says no swivel

# the line to the wrist with two normals, the elbow along it and off it in upper arms, sine and cosine of its flexion
Reach = tuple[Columns, float, float, float, float]
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
    cosine = clip((distance * distance - upper * upper - lower * lower) / (2.0 * upper * lower), -1.0, 1.0)
    return (axis, low, cross(axis, low)), along / upper, off / upper, math.sqrt(1.0 - cosine * cosine), cosine


@inlined
def nearest_with_room(chain: Record, position: Vector) -> Vector:
    """Return the wrist position itself, or the nearest that a fully bent elbow leaves room for.

    In the hole around the shoulder nothing tells one posture from another: a hand that crosses it threw the arm about.
    """
    nearest, distance = chain.nearest_m, norm(position)
    if distance >= nearest:
        return position
    return scale(nearest / distance, position) if distance > 1e-6 else (0.0, -nearest, 0.0)


@compiled
def swivel_of(reach: Reach, upper_arm: Columns) -> float:
    """Swivel of an upper arm about the line of `reach`."""
    return angle_of(dot(upper_arm[2], reach[0][1]), -dot(upper_arm[2], reach[0][2]))


@compiled
def elbow_swivel(reach: Reach, upper_arm: Columns) -> float:
    """Swivel of the elbow itself, which a carrying angle takes out of the arm's plane; if straight, the plane's."""
    out, aside = -dot(upper_arm[1], reach[0][1]), -dot(upper_arm[1], reach[0][2])
    if out * out + aside * aside < NEARLY_STRAIGHT * NEARLY_STRAIGHT:
        return swivel_of(reach, upper_arm)
    return angle_of(aside, out)


@inlined
def elbow_side(axis: Vector, upper_arm: Columns) -> Vector:
    """Direction [unit] from the line along `axis` to the elbow, at the swivel of an upper arm."""
    side = cross(axis, upper_arm[2])
    length = norm(side)
    return scale(1.0 / length, side) if length > 1e-9 else upper_arm[0]


@inlined
def side_at(reach: Reach, swivel: float) -> Vector:
    """Direction [unit] from the line of `reach` to the elbow, at a swivel."""
    s, c = sine_cosine(swivel)
    return add(scale(c, reach[0][1]), scale(s, reach[0][2]))


@inlined
def bones_at(reach: Reach, side: Vector) -> tuple[Columns, Columns]:
    """Upper arm, and forearm before pronation, with the elbow on a side of the line."""
    (axis, _, _), along, off, sine, cosine = reach
    y = subtract(scale(-along, axis), scale(off, side))
    z = cross(side, axis)
    x = cross(y, z)
    return (x, y, z), (add(scale(cosine, x), scale(sine, y)), subtract(scale(cosine, y), scale(sine, x)), z)


@compiled
def posture_at(reach: Reach, rotation: Columns, swivel: float) -> Posture:
    """The arm whose wrist is where `reach` says and whose hand bone has `rotation`; angles not held to any range."""
    upper_arm, forearm = bones_at(reach, side_at(reach, swivel))
    pronation, wrist_flexion, deviation = hand_angles(forearm, rotation)
    return upper_arm, angle_of(reach[3], reach[4]), pronation, wrist_flexion, deviation


@inlined
def hand_angles(forearm: Columns, hand: Columns) -> tuple[float, float, float]:
    """Pronation, wrist flexion and deviation that take a forearm before pronation to a hand bone."""
    fx, fy, z = forearm
    tx, ty, tz = hand
    sine = clip(dot(fy, tx), -1.0, 1.0)
    return (
        from_above(angle_of(-dot(z, tx), dot(fx, tx))),
        angle_of(sine, math.sqrt(1.0 - sine * sine)),
        angle_of(-dot(fy, tz), dot(fy, ty)),
    )


@inlined
def turn_hand(chain: Record, configuration: Any, angles: Vector) -> None:
    """Write pronation, wrist flexion and deviation into a configuration (10,), as far as the joints go."""
    for i in range(3):
        configuration[6 + i] = clip(angles[i], chain.lower[2 + i], chain.upper[2 + i])


@inlined
def from_above(pronation: float) -> float:
    """Return a pronation in (-pi, pi] as one in (-pi/2, 3 pi/2]: the range of the joint lies well inside that."""
    return pronation + 2.0 * math.pi if pronation < -0.5 * math.pi else pronation


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
    if not swing_surely_inside(chain, upper_arm):  # by more than any margin asked for
        swing = max(swing_excess(chain, scale(-1.0, upper_arm[1])) + margin, 0.0)
        total += swing * swing
    twist, height = twist_of(upper_arm), -upper_arm[1][1]
    ahead = twist_beyond(chain, twist, height, margin)
    return total + ahead * ahead


@compiled
def take(chain: Record, posture: Posture, configuration: Any) -> None:
    """Write a posture into a configuration (10,), brought inside all limits."""
    upper_arm, flexion, pronation, wrist_flexion, deviation = posture
    q = clamp_shoulder(chain, from_columns(*upper_arm))
    for i in range(4):
        configuration[i] = q[i]
    configuration[4] = clip(flexion, chain.lower[0], chain.upper[0])
    configuration[5] = clip(0.0, chain.lower[1], chain.upper[1])
    turn_hand(chain, configuration, (pronation, wrist_flexion, deviation))
    configuration[9] = clip(0.0, chain.lower[5], chain.upper[5])
