"""Where the elbow feels at home: the discomfort of a posture, and how it changes with the elbow's swivel.

Hand position and rotation leave the elbow's swivel free. People choose it so that no joint is far from the middle of
its use. Discomfort is a sum of

- wrist flexion and deviation, quadratic while small and flat when large (a Cauchy penalty): a bent wrist is avoided,
  but how a hand was mounted on its tracker shifts these angles, so a large one is no stronger evidence than a fair one,
  and half of what is usual for a person counts as their rest;
- pronation, quadratic around its rest;
- humeral twist, quadratic around a rest that depends on where the upper arm points (Donders' law of the arm: Hore,
  Watts & Vilis 1992; Gielen et al. 1997);
- the pull of the upper arm's weight, down and slightly out of the body's way;
- a rise ahead of every limit, so that the elbow makes way before the hand is stuck;
  how the edges of swing and twist themselves bend is left out of its derivatives.

The constants are fitted to recorded elbows by `tests/bench/fit_elbow_comfort.py`, on the CMU and Xia recordings alone.
"""

from __future__ import annotations

from typing import Any

from arm_ik_service.arm.chain import Columns
from arm_ik_service.arm.limits import swing_excess, swing_gradient, swing_surely_inside, twist_range
from arm_ik_service.compiled import Record, compiled, inlined
from arm_ik_service.geometry import jet
from arm_ik_service.geometry.jet import Jet
from arm_ik_service.geometry.scalar import Vector, add, components, dot, scale, subtract
from arm_ik_service.ik.swivel import Reach, bones_at, from_above

# The fitted constants, in the order of the record field `comfort`: angles [rad], weights [1/rad^2], the rest of the
# twist per unit of the humerus' direction [rad], pulls per unit of it.
COMFORT: dict[str, float] = {
    "pronation_rest": 1.35,
    "pronation_weight": 0.05,
    "flexion_weight": 1.2,
    "deviation_weight": 1.75,
    "twist_weight": 0.24,
    "twist_rest": 0.0,
    "twist_forward": 0.3,
    "twist_up": 0.35,
    "twist_out": -0.8,
    "pull_down": 0.4,
    "pull_out": 0.9,
}
WRIST_SCALE = 0.5  # [rad] half of the wrist's functional range (Ryu et al. 1991): beyond, the penalty flattens
HABIT_SHARE = 0.5  # of a person's usual wrist flexion and deviation that counts as their rest
HABIT_TIME_S = 5.0  # over which the usual is averaged
LIMIT_MARGIN = 0.3  # [rad] ahead of a limit where discomfort begins to rise
SWING_MARGIN = 0.1  # [rad] the same for the swing, as far as `swing_surely_inside` tells
LIMIT_WEIGHT = 1.0  # [1/rad^2] how steeply; gently, so that the elbow starts no sooner than an elbow can


@inlined
def discomfort(comfort: Any, habit: Any, chain: Record, reach: Reach, rotation: Columns, side: Vector) -> Jet:
    """How far the arm is from comfortable, with first and second derivative over the swivel; no unit.

    `comfort` is COMFORT's values, `habit` the person's usual wrist flexion and deviation [rad], `side` the direction of
    the elbow from the line between shoulder and wrist. Swivelling turns all of the arm about that line, past a hand
    that stays.
    """
    axis, (tx, ty, tz) = reach[0][0], rotation
    upper_arm, forearm = bones_at(reach, side)
    x, y, z = jet.turning(axis, upper_arm[0]), jet.turning(axis, upper_arm[1]), jet.turning(axis, upper_arm[2])
    fx, fy = jet.turning(axis, forearm[0]), jet.turning(axis, forearm[1])
    pronation = jet.angle(jet.along(z, scale(-1.0, tx)), jet.along(fx, tx))
    pronation = jet.shift(pronation, from_above(pronation[0]) - pronation[0])
    flexion = jet.arcsine(jet.along(fy, tx))
    deviation = jet.angle(jet.along(fy, scale(-1.0, tz)), jet.along(fy, ty))
    twist = jet.angle(subtract(jet.component(z, 0), jet.component(x, 2)), add(jet.component(x, 0), jet.component(z, 2)))

    # the humerus points along -y
    turned = add(jet.shift(twist, -comfort[5]), jet.along(y, (comfort[6], comfort[7], comfort[8])))
    total = jet.square(comfort[1], jet.shift(pronation, -comfort[0]))
    total = add(total, jet.cauchy(comfort[2], WRIST_SCALE, jet.shift(flexion, -HABIT_SHARE * habit[0])))
    total = add(total, jet.cauchy(comfort[3], WRIST_SCALE, jet.shift(deviation, -HABIT_SHARE * habit[1])))
    total = add(total, jet.square(comfort[4], turned))
    total = add(total, subtract(scale(comfort[10], jet.component(y, 2)), scale(comfort[9], jet.component(y, 1))))

    lower, upper, m = chain.lower, chain.upper, LIMIT_MARGIN
    total = add(total, jet.square(LIMIT_WEIGHT, jet.outside(pronation, lower[2] + m, upper[2] - m)))
    total = add(total, jet.square(LIMIT_WEIGHT, jet.outside(flexion, lower[3] + m, upper[3] - m)))
    total = add(total, jet.square(LIMIT_WEIGHT, jet.outside(deviation, lower[4] + m, upper[4] - m)))
    lowest, highest = twist_range(chain, -y[0][1])
    total = add(total, jet.square(LIMIT_WEIGHT, jet.outside(twist, lowest + m, highest - m)))
    beyond = -1.0 if swing_surely_inside(chain, upper_arm) else swing_excess(chain, scale(-1.0, y[0])) + SWING_MARGIN
    if beyond > 0.0:
        rate = dot(swing_gradient(chain, upper_arm), components(upper_arm, axis))
        total = add(total, jet.square(LIMIT_WEIGHT, (beyond, rate, 0.0)))
    return total


@compiled
def learn_habit(habit: Any, configuration: Any, dt_s: float) -> None:
    """Move the usual wrist flexion and deviation towards those of a configuration (10,) held for dt_s."""
    share = dt_s / (HABIT_TIME_S + dt_s)
    habit[0] += share * (configuration[7] - habit[0])
    habit[1] += share * (configuration[8] - habit[1])
