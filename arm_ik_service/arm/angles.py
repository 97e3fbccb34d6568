"""The nine joint angles and the ISB shoulder angles that people read, from a configuration, with their rates.

The shoulder is swing-twist from the hanging arm: flexion and abduction are the parts of the swing's rotation vector
about the lateral and the anterior axis, so both vary smoothly at rest, where ISB's Y-X-Y angles are singular.
"""

from __future__ import annotations

import math
from typing import Any

from arm_ik_service.arm.chain import columns_of
from arm_ik_service.arm.limits import twist_gradient, twist_of
from arm_ik_service.compiled import compiled
from arm_ik_service.geometry.scalar import wrap

_SINGULAR = 0.1  # sine of the elevation below which plane of elevation and axial rotation mean little (6 degrees)


@compiled
def joint_angles(configuration: Any, velocity: Any, angles: Any, rates: Any) -> None:
    """Fill angles (9,) [rad] and rates (9,) [rad/s] in the order of arm.model.ANGLES."""
    q = (configuration[0], configuration[1], configuration[2], configuration[3])
    x, y, z = columns_of(q)
    forward, height, right = -y[0], -y[1], -y[2]  # where the humerus points
    sine = math.sqrt(forward * forward + right * right)
    elevation = math.atan2(sine, -height)
    stretch = elevation / sine if sine > 1e-6 else (1.0 if height < 0.0 else math.pi / 1e-6)
    angles[0], angles[1], angles[2] = stretch * forward, stretch * right, twist_of((x, y, z))

    # u = -y turns at omega x u; in body axes (wz, 0, -wx)
    wx, wz = velocity[0], velocity[2]
    forward_rate, height_rate, right_rate = wz * x[0] - wx * z[0], wz * x[1] - wx * z[1], wz * x[2] - wx * z[2]
    if sine > 1e-3:
        stretch_slope = (sine + elevation * height) / (sine * sine * sine) * height_rate
    else:
        stretch_slope = height_rate / 3.0
    rates[0] = stretch * forward_rate + stretch_slope * forward
    rates[1] = stretch * right_rate + stretch_slope * right
    gradient = twist_gradient(q)
    rates[2] = gradient[0] * wx + velocity[1] + gradient[2] * wz
    for i in range(6):
        angles[3 + i], rates[3 + i] = configuration[4 + i], velocity[3 + i]


@compiled
def isb_shoulder(configuration: Any, isb: Any) -> int:
    """Fill plane of elevation, elevation, axial rotation (3,) [rad] (Wu et al. 2005, Y-X-Y); return 1 where singular.

    Elevation is positive here; plane 0 is abduction, 90 degrees forward flexion; axial rotation is positive inwards.
    """
    bone = columns_of((configuration[0], configuration[1], configuration[2], configuration[3]))
    forward, height, right = -bone[1][0], -bone[1][1], -bone[1][2]
    sine = math.sqrt(forward * forward + right * right)
    isb[0] = math.atan2(forward, right)
    isb[1] = math.atan2(sine, -height)
    isb[2] = wrap(twist_of(bone) - isb[0])
    return 1 if sine < _SINGULAR else 0
