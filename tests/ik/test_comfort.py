"""The elbow's discomfort: its derivatives are the derivatives, and it rises ahead of limits."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from arm_ik_service.arm.chain import Columns, columns_of, hand_to_arm, position_to_arm
from arm_ik_service.arm.limits import swing_surely_inside, twist_of
from arm_ik_service.arm.model import ArmModel
from arm_ik_service.compiled import Record
from arm_ik_service.geometry.jet import Jet
from arm_ik_service.ik.comfort import COMFORT, LIMIT_MARGIN, LIMIT_WEIGHT, SWING_MARGIN, discomfort
from arm_ik_service.ik.swivel import Reach, elbow_side, posture_at, reach_to, side_at, swivel_of, violation

RIGHT = ArmModel.load()
CHAIN = RIGHT.chains[0]
UNLIMITED = RIGHT.chains.copy()[0]
UNLIMITED["lower"] = UNLIMITED["twist_lower"] = -9.0
UNLIMITED["upper"] = UNLIMITED["twist_upper"] = 9.0
UNLIMITED["swing_surely_inside"] = -2.0


def at(reach: Reach, rotation: Columns, swivel: float, chain: Record = CHAIN) -> Jet:
    constants, habit = np.array(list(COMFORT.values())), np.array([0.2, -0.1])
    return discomfort(constants, habit, chain, reach, rotation, side_at(reach, swivel))


def postures(share: float, count: int) -> list[tuple[Reach, Columns, float]]:
    """Reach, hand rotation and swivel of random configurations over the middle `share` of every range."""
    found = []
    for q in RIGHT.random_configurations(count, np.random.default_rng(1), share):
        hand: npt.NDArray[np.float64] = RIGHT.forward(q)["hand"]
        position = position_to_arm(CHAIN, (hand[0], hand[1], hand[2]))
        reach = reach_to(CHAIN, position)
        rotation = columns_of(hand_to_arm(CHAIN, (hand[3], hand[4], hand[5], hand[6])))
        found.append((reach, rotation, swivel_of(reach, columns_of((q[0], q[1], q[2], q[3])))))
    return found


@pytest.mark.parametrize("share", [0.5, 0.8, 0.99])
def test_slope_and_curvature_are_the_finite_differences(share: float) -> None:
    h, checked, curved = 1e-4, 0, 0
    for reach, rotation, swivel in postures(share, 150):
        near = [at(reach, rotation, swivel + s * h) for s in (-1, 0, 1)]
        if any(abs(jet[2]) > 50.0 for jet in near):
            continue  # near a pole of the wrist's angles, where differences say nothing
        upper_arm = posture_at(reach, rotation, swivel)[0]
        if -upper_arm[1][1] > 0.7:
            continue  # where the range of twist opens, its rate is left out
        slope = (near[2][0] - near[0][0]) / (2 * h)
        assert near[1][1] == pytest.approx(slope, abs=1e-4 * (1 + abs(slope)))
        checked += 1
        inside = swing_surely_inside(CHAIN, upper_arm) and abs(twist_of(upper_arm)) < 1.4
        if inside and violation(CHAIN, posture_at(reach, rotation, swivel), LIMIT_MARGIN + 0.01) == 0.0:
            curvature = (near[2][1] - near[0][1]) / (2 * h)
            assert near[1][2] == pytest.approx(curvature, abs=1e-3 * (1 + abs(curvature)))
            curved += 1
    assert checked > 60
    assert curved > 20 or share > 0.9


def test_a_side_and_its_swivel_say_the_same() -> None:
    for reach, rotation, swivel in postures(0.9, 50):
        upper_arm = posture_at(reach, rotation, swivel)[0]
        assert elbow_side(reach[0][0], upper_arm) == pytest.approx(side_at(reach, swivel), abs=1e-9)


def test_discomfort_rises_ahead_of_every_limit_and_nowhere_else() -> None:
    free = beyond = 0
    for reach, rotation, start in postures(0.99, 200):
        for swivel in start + np.linspace(-1.0, 1.0, 9):
            posture = posture_at(reach, rotation, swivel)
            extra = at(reach, rotation, swivel)[0] - at(reach, rotation, swivel, UNLIMITED)[0]
            if violation(CHAIN, posture, 0.0) > 0.0:
                assert extra > LIMIT_WEIGHT * SWING_MARGIN**2
                beyond += 1
            elif swing_surely_inside(CHAIN, posture[0]) and violation(CHAIN, posture, LIMIT_MARGIN) == 0.0:
                assert extra == pytest.approx(0.0, abs=1e-12)
                free += 1
    assert min(free, beyond) > 100
