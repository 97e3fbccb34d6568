"""The compiled stage: what goes out is one pose, its velocity is the derivative of it, and it never fails."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from streams import Array, central_differences, random_stream, run, targets_of

from arm_ik_service.arm.model import LIMITS, ArmModel
from arm_ik_service.body.state import TARGET
from arm_ik_service.geometry import batch
from arm_ik_service.ik.state import new_arm
from arm_ik_service.ik.step import predict, step_arm
from arm_ik_service.settings import SolverSettings, to_record
from arm_ik_service.wire.messages import SIDES

RIGHT = ArmModel.load()
DT_S = 1.0 / 90.0
SETTINGS = to_record(SolverSettings())


def smooth_stream(seed: int, arm: ArmModel = RIGHT) -> Array:
    """A hand well inside all ranges, at most 2 m/s."""
    return random_stream(arm, seed, share=0.4, most_m_s=2.0)[1]


def rms(values: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


@pytest.mark.parametrize("side", ["left", "right"])
def test_velocity_is_the_derivative_of_the_configuration_on_smooth_motion(side: str) -> None:
    arm = ArmModel.load(side)  # type: ignore[arg-type]
    ratios = []
    for seed in range(6):
        answer = run(arm, targets_of(smooth_stream(seed, arm), DT_S), DT_S)
        truth = central_differences(answer.configuration, DT_S)[30:-1]
        ratios.append(rms(answer.velocity[30:-1] - truth) / rms(truth))
    assert np.median(ratios, axis=0).max() <= 0.03
    assert np.max(ratios) <= 0.06


def test_velocity_has_no_spikes_at_limits() -> None:
    checked = 0
    for seed in (*range(4), 8, 20, 26, 27, 29):  # the last five had some
        answer = run(RIGHT, targets_of(random_stream(RIGHT, seed, most_m_s=3.0)[1], DT_S), DT_S)
        truth = central_differences(answer.configuration, DT_S)
        near = np.array([np.nanmax(np.abs(truth[max(0, n - 3) : n + 4]), axis=0) for n in range(len(truth))])
        calm = np.convolve(answer.restarted, np.ones(9), "same") == 0
        chosen = calm & ((answer.limits & 0xFF) != 0) & (np.arange(len(truth)) > 30)
        checked += int(chosen.sum())
        # half a radian a second is the noise of a joint that hardly moves
        assert (np.abs(answer.velocity[chosen]) <= 1.5 * near[chosen] + 0.5).all()
    assert checked > 50


def test_joints_at_a_limit_do_not_move_outward() -> None:
    answer = run(RIGHT, targets_of(random_stream(RIGHT, 4)[1], DT_S), DT_S)
    angles, rates, chain = answer.configuration[:, 4:], answer.velocity[:, 3:], RIGHT.chains[0]
    at_lower, at_upper = angles <= chain["lower"] + 1e-12, angles >= chain["upper"] - 1e-12
    assert min(at_lower.sum(), at_upper.sum()) > 20
    assert rates[at_lower].min() > -1e-9
    assert rates[at_upper].max() < 1e-9


def test_a_speed_limit_scales_all_joints_alike() -> None:
    hands = smooth_stream(1)
    free, slow = new_arm(RIGHT), new_arm(RIGHT)
    slow["chain"]["speed_limit"] = 0.3
    bound = 0
    for target in targets_of(hands, DT_S)[:300]:
        step_arm(free[0], target, DT_S, SETTINGS)
        step_arm(slow[0], target, DT_S, SETTINGS)
        fast, scaled = free[0].velocity, slow[0].velocity
        assert np.abs(scaled).max() <= 0.3 + 1e-12
        if np.abs(fast).max() > 0.3:
            bound += 1
            assert slow[0].limits >> LIMITS.index("joint_speed") & 1
            np.testing.assert_allclose(scaled * np.abs(fast).max() / 0.3, fast, atol=1e-9)
    assert bound > 100


def test_prediction_lands_where_the_hand_will_be() -> None:
    targets = targets_of(smooth_stream(2), DT_S)
    arms, ahead = new_arm(RIGHT), np.empty(10)
    predicted, still = [], []
    for now, later in zip(targets[:-2], targets[2:], strict=True):
        step_arm(arms[0], now, DT_S, SETTINGS)
        predict(arms[0], 2 * DT_S, ahead)
        assert np.abs(RIGHT.excess(ahead)).max() < 1e-9
        hand = RIGHT.forward(ahead)["hand"]
        predicted.append(np.linalg.norm(hand[:3] - later["position"]))
        still.append(np.linalg.norm(now["position"] - later["position"]))
    assert np.median(predicted[30:]) < 0.15 * np.median(still[30:])


def test_bones_are_the_forward_kinematics_of_the_configuration() -> None:
    for side in SIDES:
        arm = ArmModel.load(side)
        arms = new_arm(arm)
        for target in targets_of(smooth_stream(3, arm), DT_S)[:20]:
            step_arm(arms[0], target, DT_S, SETTINGS)
            poses = arm.forward(arms[0].shown)
            np.testing.assert_allclose(arms[0].elbow, poses["elbow"][:3])
            np.testing.assert_allclose(arms[0].wrist, poses["hand"][:3])
            np.testing.assert_allclose(arms[0].forearm_rotation, poses["elbow"][3:])
            np.testing.assert_allclose(arms[0].hand_rotation, poses["hand"][3:])
            along = batch.rotate(arms[0].upper_arm_rotation, [0.0, -arm.upper_arm_m, 0.0])
            np.testing.assert_allclose(along, arms[0].elbow, atol=1e-12)


def test_a_left_arm_steps_as_the_mirror_of_a_right_one_to_the_last_bit() -> None:
    hands = smooth_stream(4)
    right = run(RIGHT, targets_of(hands, DT_S), DT_S)
    mirrored = targets_of(batch.mirror_pose(hands), DT_S)
    left = run(ArmModel.load("left"), mirrored, DT_S)
    np.testing.assert_array_equal(right.configuration, left.configuration)
    np.testing.assert_array_equal(right.elbow * [-1, 1, 1], left.elbow)
    np.testing.assert_allclose(right.velocity, left.velocity, atol=1e-9)


def test_the_mask_names_the_limits_that_the_arm_rests_on() -> None:
    target = np.zeros(1, TARGET)
    target["position"], target["rotation"] = [0.05, -0.06, -0.05], [0.0, 0.0, 0.0, 1.0]
    arms = new_arm(RIGHT)
    for _ in range(50):
        step_arm(arms[0], target[0], DT_S, SETTINGS)
    names = {name for bit, name in enumerate(LIMITS) if arms[0].limits >> bit & 1}
    assert "elbow_flexion" in names
    assert arms[0].shown[4] == pytest.approx(RIGHT.upper[0])


def test_a_teleporting_hand_is_followed_and_stays_finite() -> None:
    rng = np.random.default_rng(5)
    targets = np.zeros(300, TARGET)
    targets["position"] = rng.uniform(-1.0, 1.0, (300, 3))  # most of them out of reach or behind the back
    targets["rotation"] = batch.normalized(rng.normal(size=(300, 4)))
    targets["linear_velocity"] = rng.normal(0.0, 20.0, (300, 3))
    targets["angular_velocity"] = rng.normal(0.0, 50.0, (300, 3))
    targets["position"][::40] = 0.0  # in the shoulder itself
    answer = run(RIGHT, targets, 0.0)
    for values in (answer.configuration, answer.velocity, answer.elbow, answer.confidence, answer.position_error_m):
        assert np.isfinite(values).all()
    assert np.abs(RIGHT.excess(answer.configuration)).max() < 1e-9
    assert (np.abs(answer.velocity) <= RIGHT.speed_limit + 1e-9).all()
    assert answer.iterations.max() <= SolverSettings().iterations


def test_confidence_is_between_nothing_and_one_and_says_something() -> None:
    confidence = run(RIGHT, targets_of(random_stream(RIGHT, 6)[1], DT_S), DT_S).confidence
    assert (confidence >= 0.0).all()
    assert (confidence <= 1.0).all()
    assert np.ptp(confidence) > 0.3


PLAIN = """
import numpy as np
from arm_ik_service.arm.model import ArmModel
from arm_ik_service.ik.state import new_arm
from arm_ik_service.ik.step import step_arm
from arm_ik_service.settings import SolverSettings, to_record
from arm_ik_service.wire.messages import SIDES
from streams import random_stream, targets_of
arm = ArmModel.load()
arms, settings = new_arm(arm), to_record(SolverSettings())
for target in targets_of(random_stream(arm, 0, frames=12)[1], 1 / 90):
    step_arm(arms[0], target, 1 / 90, settings)
print(repr(np.concatenate([arms[0].shown, arms[0].velocity]).tolist()))
"""


def test_it_runs_as_plain_python_too_and_answers_the_same() -> None:
    outputs = []
    for disabled in ("0", "1"):
        environment = {**os.environ, "NUMBA_DISABLE_JIT": disabled, "PYTHONPATH": os.pathsep.join(sys.path)}
        done = subprocess.run(
            [sys.executable, "-c", PLAIN], env=environment, capture_output=True, text=True, check=True, timeout=120
        )
        outputs.append(np.array(eval(done.stdout)))
    np.testing.assert_allclose(outputs[0], outputs[1], atol=1e-9)


def test_a_nearly_straight_arm_keeps_a_carrying_angle_that_leaves_out_zero() -> None:
    arm = ArmModel.load(limits={"elbow_carrying": (-0.26, -0.09)})
    straight = arm.rest.copy()
    straight[4], straight[5] = 0.1, -0.09
    hands = np.tile(arm.forward(straight[None])["hand"][0], (60, 1))
    hands[:, 1] += np.linspace(0.0, 0.02, 60)
    answer = run(arm, targets_of(hands, DT_S), DT_S)
    assert np.abs(arm.excess(answer.configuration)).max() < 1e-9
