"""The arm as compiled code sees it: the model file flattened into one record, and its forward kinematics.

All of it is the right arm in ISB axes (x anterior, y proximal, z to the right), positions from the glenohumeral joint.
A left arm is mirrored into this frame on the way in and out of it on the way out, here and nowhere else.
A rotation is kept as its three columns: the six hinges are plane rotations of two columns each, and the columns are
the joint axes that J^T e and J s need anyway.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from arm_ik_service.compiled import Record, compiled, inlined, record_dtype
from arm_ik_service.geometry.scalar import (
    Quaternion,
    Vector,
    add,
    from_columns,
    mirror_rotation,
    mirror_vector,
    multiply,
    rotate,
    scale,
)
from arm_ik_service.geometry.trigonometry import sine_cosine

Columns = tuple[Vector, Vector, Vector]

CHAIN = record_dtype(
    [
        ("left", np.int64),  # 1 for a left arm
        ("shoulder_from_isb", np.float64, (4,)),  # OpenXR shoulder axes from ISB axes at rest
        ("bone_from_hand", np.float64, (4,)),  # ISB hand axes from the OpenXR wrist frame
        ("upper_arm_m", np.float64),
        ("forearm_m", np.float64),
        ("nearest_m", np.float64),  # wrist to shoulder with the elbow fully bent
        ("lower", np.float64, (6,)),  # the six hinges [rad], order of the configuration
        ("upper", np.float64, (6,)),
        ("twist_lower", np.float64),  # humerus, external [rad]
        ("twist_upper", np.float64),  # internal
        ("twist_middle", np.float64, (2,)),  # cosine and sine of the middle of that range
        ("twist_surely_inside", np.float64),  # cosine of an angle from the middle that lies inside at any height
        ("swing_centre", np.float64, (3,)),  # unit direction in the middle of the shoulder's swing region
        ("swing_side", np.float64, (3,)),  # azimuth 0 around it
        ("swing_up", np.float64, (3,)),  # azimuth 90 degrees
        ("swing_cosines", np.float64, (5,)),  # Fourier series of the angle from the centre to the edge [rad]
        ("swing_sines", np.float64, (5,)),
        ("swing_surely_inside", np.float64, (8,)),  # cosine of an angle inside the edge by 0.1 rad, for each octant
        ("speed_limit", np.float64, (9,)),  # [rad/s], tangent order
    ]
)


@inlined
def columns_of(q: Quaternion) -> Columns:
    """Return the rotated x, y and z axes of a unit quaternion."""
    x, y, z, w = q
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)),
        (2.0 * (x * y - z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + x * w)),
        (2.0 * (x * z + y * w), 2.0 * (y * z - x * w), 1.0 - 2.0 * (x * x + y * y)),
    )


@inlined
def turn(a: Vector, b: Vector, angle: float) -> tuple[Vector, Vector]:
    """Rotate the orthonormal pair (a, b) in its own plane, a towards b [rad]."""
    s, c = sine_cosine(angle)
    return (
        (c * a[0] + s * b[0], c * a[1] + s * b[1], c * a[2] + s * b[2]),
        (c * b[0] - s * a[0], c * b[1] - s * a[1], c * b[2] - s * a[2]),
    )


@inlined
def turn_group(base: Columns, about_z: float, about_x: float, about_y: float) -> tuple[Vector, Vector, Columns]:
    """Three hinges Z, X, Y on the bone `base`: the axes of the second and third hinge, and the next bone's columns."""
    x, y = turn(base[0], base[1], about_z)
    y, z = turn(y, base[2], about_x)
    second, third = x, y
    z, x = turn(z, x, about_y)
    return second, third, (x, y, z)


@compiled
def forearm_columns(configuration: Any) -> Columns:
    """ISB axes of the forearm bone at a configuration (10,)."""
    base = columns_of((configuration[0], configuration[1], configuration[2], configuration[3]))
    return turn_group(base, configuration[4], configuration[5], configuration[6])[2]


@compiled
def hand_columns(configuration: Any) -> Columns:
    """ISB axes of the hand bone at a configuration (10,)."""
    return turn_group(forearm_columns(configuration), configuration[7], configuration[8], configuration[9])[2]


@compiled
def wrist_at(chain: Record, configuration: Any) -> Vector:
    """Return the wrist [m] of a configuration (10,), right arm, ISB axes."""
    base = columns_of((configuration[0], configuration[1], configuration[2], configuration[3]))
    elbow = scale(-chain.upper_arm_m, base[1])
    return add(elbow, scale(-chain.forearm_m, forearm_columns(configuration)[1]))


@compiled
def forward(chain: Record, configuration: Any) -> tuple[Vector, Vector, Quaternion, Quaternion, Quaternion]:
    """Return elbow and wrist [m] and the rotations of upper arm, forearm and hand bone, right arm, ISB axes."""
    q = (configuration[0], configuration[1], configuration[2], configuration[3])
    base = columns_of(q)
    lower = turn_group(base, configuration[4], configuration[5], configuration[6])[2]
    hand = turn_group(lower, configuration[7], configuration[8], configuration[9])[2]
    elbow = scale(-chain.upper_arm_m, base[1])
    wrist = add(elbow, scale(-chain.forearm_m, lower[1]))
    return elbow, wrist, q, from_columns(*lower), from_columns(*hand)


@compiled
def position_to_arm(chain: Record, v: Vector) -> Vector:
    """Take a position or a linear velocity from shoulder axes into the right arm's ISB axes."""
    if chain.left:
        v = mirror_vector(v)
    s = chain.shoulder_from_isb
    return rotate((-s[0], -s[1], -s[2], s[3]), v)


@compiled
def position_from_arm(chain: Record, v: Vector) -> Vector:
    """Undo position_to_arm."""
    s = chain.shoulder_from_isb
    v = rotate((s[0], s[1], s[2], s[3]), v)
    return mirror_vector(v) if chain.left else v


@compiled
def spin_to_arm(chain: Record, w: Vector) -> Vector:
    """Take an angular velocity (an axial vector) from shoulder axes into the right arm's ISB axes."""
    if chain.left:
        w = (w[0], -w[1], -w[2])
    s = chain.shoulder_from_isb
    return rotate((-s[0], -s[1], -s[2], s[3]), w)


@compiled
def spin_from_arm(chain: Record, w: Vector) -> Vector:
    """Undo spin_to_arm."""
    s = chain.shoulder_from_isb
    w = rotate((s[0], s[1], s[2], s[3]), w)
    return (w[0], -w[1], -w[2]) if chain.left else w


@compiled
def hand_to_arm(chain: Record, q: Quaternion) -> Quaternion:
    """Take an OpenXR wrist rotation in shoulder axes to the hand bone's rotation in the right arm's ISB axes."""
    if chain.left:
        q = mirror_rotation(q)
    s, h = chain.shoulder_from_isb, chain.bone_from_hand
    return multiply(multiply((-s[0], -s[1], -s[2], s[3]), q), (-h[0], -h[1], -h[2], h[3]))


@compiled
def hand_from_arm(chain: Record, q: Quaternion) -> Quaternion:
    """Undo hand_to_arm."""
    s, h = chain.shoulder_from_isb, chain.bone_from_hand
    q = multiply(multiply((s[0], s[1], s[2], s[3]), q), (h[0], h[1], h[2], h[3]))
    return mirror_rotation(q) if chain.left else q


@compiled
def bone_from_arm(chain: Record, q: Quaternion) -> Quaternion:
    """Take a bone's rotation (ISB axes) from the right arm's frame into shoulder axes of its own side.

    A left bone's axes are ISB's too: x anterior, y proximal, z to the person's right.
    """
    s = chain.shoulder_from_isb
    if chain.left:
        q = _mirror_isb(q)
    return multiply((s[0], s[1], s[2], s[3]), q)


@compiled
def _mirror_isb(q: Quaternion) -> Quaternion:
    """Reflect a rotation given in ISB axes in the sagittal plane z = 0."""
    return (-q[0], -q[1], q[2], q[3])


@compiled
def forward_poses(chains: Any, configurations: Any, elbows: Any, wrists: Any, hands: Any) -> None:
    """Fill poses (N, 7) of elbow (forearm bone at the elbow), wrist (hand bone) and hand in the shoulder frame.

    `chains` is an array of one CHAIN, configurations (N, 10).
    """
    chain = chains[0]
    for n in range(len(configurations)):
        elbow, wrist, _, lower, bone = forward(chain, configurations[n])
        elbow, wrist = position_from_arm(chain, elbow), position_from_arm(chain, wrist)
        for i in range(3):
            elbows[n, i] = elbow[i]
            wrists[n, i] = wrist[i]
            hands[n, i] = wrist[i]
        lower, hand, bone = bone_from_arm(chain, lower), hand_from_arm(chain, bone), bone_from_arm(chain, bone)
        for i in range(4):
            elbows[n, 3 + i] = lower[i]
            wrists[n, 3 + i] = bone[i]
            hands[n, 3 + i] = hand[i]
