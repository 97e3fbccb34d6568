"""One person through all stages: what goes in comes out as arms, the same each time."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from harness import standing

from arm_ik_service import Avatar, Avatars, Profile, Settings
from arm_ik_service.body.profile import BodyMeasures
from arm_ik_service.io.session import open_session
from arm_ik_service.programs.demo import bundled_session
from arm_ik_service.wire.messages import ControllerFrame, TrackedPose


@pytest.fixture(scope="module")
def frames() -> list[ControllerFrame]:
    """Five seconds of boxing."""
    return [recorded.frame for recorded in open_session(bundled_session("boxing")).frames()][:450]


def test_the_same_frames_give_the_same_bytes(frames: list[ControllerFrame]) -> None:
    one, two = Avatar(), Avatar()
    for frame in frames:
        first, second = (avatar.step(frame, frame.sample_time_ns) for avatar in (one, two))
        assert msgspec.msgpack.encode(first) == msgspec.msgpack.encode(second)


def test_a_row_that_another_person_left_is_as_good_as_new(frames: list[ControllerFrame]) -> None:
    fresh, used = Avatars(), Avatars()
    used.reset(0, Profile())
    for frame in frames:
        used.add(0, frame, frame.sample_time_ns)
        used.step()
    for avatars in (fresh, used):
        avatars.reset(0, Profile())
    for frame in frames[:3]:
        answers = []
        for avatars in (fresh, used):
            avatars.add(0, frame, frame.sample_time_ns)
            avatars.step()
            answers.append(msgspec.msgpack.encode(avatars.answer(0, frame, "one", 0)))
        assert answers[0] == answers[1]


def test_a_mirrored_person_moves_the_other_arm_the_same(frames: list[ControllerFrame]) -> None:
    def mirrored(pose: TrackedPose | None) -> TrackedPose | None:
        if pose is None:
            return None
        (x, y, z), (qx, qy, qz, qw) = pose.position, pose.orientation
        return TrackedPose((-x, y, z), (qx, -qy, -qz, qw), pose.flags)

    plain, mirror = Avatar(), Avatar()
    for frame in frames:
        seen = msgspec.structs.replace(
            frame, head=mirrored(frame.head), left=mirrored(frame.right), right=mirrored(frame.left)
        )
        state, reflected = plain.step(frame, frame.sample_time_ns), mirror.step(seen, seen.sample_time_ns)
        assert state is not None
        assert reflected is not None
        assert reflected.left.configuration == pytest.approx(state.right.configuration, abs=1e-6)
        x, y, z = state.right.bones.forearm.position
        assert reflected.left.bones.forearm.position == pytest.approx((-x, y, z), abs=1e-6)


def test_what_is_published_hangs_together(frames: list[ControllerFrame]) -> None:
    avatar = Avatar()
    for frame in frames:
        state = avatar.step(frame, frame.sample_time_ns)
        assert state is not None
        for arm in (state.left, state.right):
            upper, lower, hand = (
                np.array(bone.position) for bone in (arm.bones.upper_arm, arm.bones.forearm, arm.bones.hand)
            )
            reach = np.linalg.norm(lower - upper) + np.linalg.norm(hand - lower)
            assert 0.45 < reach < 0.75
            assert np.linalg.norm(arm.configuration[:4]) == pytest.approx(1.0)
            assert arm.angles.elbow_flexion == arm.configuration[4]
            assert arm.angle_rates.elbow_flexion == arm.velocity[3]


def test_a_prediction_is_nearer_to_where_the_elbow_will_be_than_where_it_is(frames: list[ControllerFrame]) -> None:
    ahead = 3
    now, later = Avatar(), Avatar()
    plain, predicted = [], []
    for frame, then in zip(frames, frames[ahead:], strict=False):
        one = now.step(frame, frame.sample_time_ns)
        two = later.step(frame, frame.sample_time_ns, predict_to_ns=then.sample_time_ns)
        assert one is not None
        assert two is not None
        plain.append(one.right.bones.forearm.position)
        predicted.append(two.right.bones.forearm.position)
    true = np.array(plain[ahead:])
    without = np.linalg.norm(np.array(plain[:-ahead]) - true, axis=1)
    with_it = np.linalg.norm(np.array(predicted[:-ahead]) - true, axis=1)
    fast = without > 0.02
    assert fast.sum() > 20
    assert np.median(with_it[fast] / without[fast]) < 0.7


def test_a_prediction_leaves_the_arm_itself_alone(frames: list[ControllerFrame]) -> None:
    plain, looking_ahead = Avatar(), Avatar(settings=msgspec.convert({"solver": {"predict_s": 0.03}}, Settings))
    for frame in frames:
        one = plain.step(frame, frame.sample_time_ns)
        two = looking_ahead.step(frame, frame.sample_time_ns, predict_to_ns=frame.sample_time_ns)
        looking_ahead.step(frame, frame.sample_time_ns)  # refused as a repetition: changes nothing
        assert one == two


def test_a_frame_without_any_device_is_answered_with_finite_numbers_and_says_lost() -> None:
    empty = msgspec.structs.replace(standing(0, 0), head=None, left=None, right=None)
    state = Avatar().step(empty, 0)
    assert state is not None
    assert state.left.tracking == "lost"
    assert np.isfinite(state.left.configuration).all()
    assert state.left.bones.hand.position[1] > 0.3


def go_on(frames: list[ControllerFrame], *several: Avatars) -> None:
    """Show all of them the same frames again, ten seconds later."""
    for frame in frames:
        ns = frame.sample_time_ns + 10_000_000_000
        for avatars in several:
            avatars.add(0, msgspec.structs.replace(frame, seq=frame.seq + len(frames), sample_time_ns=ns), ns)
            avatars.step()


def test_whoever_is_taken_over_keeps_the_lengths_that_were_learnt_of_them(frames: list[ControllerFrame]) -> None:
    def tall(pose: TrackedPose | None) -> TrackedPose | None:
        if pose is None:
            return None
        x, y, z = pose.position
        return msgspec.structs.replace(pose, position=(1.15 * x, 1.15 * y, 1.15 * z))

    seen = [
        msgspec.structs.replace(frame, head=tall(frame.head), left=tall(frame.left), right=tall(frame.right))
        for frame in frames
    ]
    first, second = Avatars(), Avatars()
    for avatars in (first, second):
        avatars.reset(0, Profile())
    for frame in seen[:-1]:
        place = first.add(0, frame, frame.sample_time_ns)
        first.step()
    last = first.answer(place, seen[-2], "one", 0)
    assert second.resume(0, last)
    learnt, average = first.lengths([0]), Avatars()
    average.reset(0, Profile())
    assert np.abs(learnt - average.lengths([0])).max() > 0.05
    np.testing.assert_allclose(second.lengths([0]), learnt, atol=1e-9)
    for avatars in (first, second):
        avatars.add(0, seen[-1], seen[-1].sample_time_ns)
        avatars.step()
    np.testing.assert_allclose(second.lengths([0]), first.lengths([0]), atol=5e-3)
    go_on(seen, first, second)
    np.testing.assert_allclose(second.lengths([0]), first.lengths([0]), rtol=0.08)


@pytest.mark.parametrize("stature_m", [1.75, 1.8], ids=["open", "stated"])
@pytest.mark.parametrize("bone", ["clavicle", "forearm", "hand"])
@pytest.mark.parametrize("x_m", [float("nan"), 0.0, 7.0])
def test_lengths_that_no_person_has_are_not_taken_over(
    frames: list[ControllerFrame], x_m: float, bone: str, stature_m: float
) -> None:
    first, second = Avatars(), Avatars()
    for avatars in (first, second):
        avatars.reset(0, Profile(body=BodyMeasures(stature_m=stature_m)))
    first.add(0, frames[0], frames[0].sample_time_ns)
    first.step()
    last = first.answer(0, frames[0], "one", 0)
    bones = last.right.bones
    before_it = {"clavicle": last.left.bones.clavicle, "forearm": bones.upper_arm, "hand": bones.forearm}[bone]
    x, y, z = before_it.position
    away = msgspec.structs.replace(getattr(bones, bone), position=(x + x_m, y, z))
    arm = msgspec.structs.replace(last.right, bones=msgspec.structs.replace(bones, **{bone: away}))
    before = second.lengths([0])
    assert second.resume(0, msgspec.structs.replace(last, right=arm))
    np.testing.assert_array_equal(second.lengths([0]), before)


@pytest.mark.parametrize(
    "stated", [BodyMeasures(stature_m=1.38), BodyMeasures(stature_m=1.9), BodyMeasures(shoulder_width_m=0.4)]
)
def test_what_a_profile_states_stays_when_the_rest_is_taken_over(
    frames: list[ControllerFrame], stated: BodyMeasures
) -> None:
    first, second = Avatars(), Avatars()
    for avatars in (first, second):
        avatars.reset(0, Profile(body=stated))
    for frame in frames:
        place = first.add(0, frame, frame.sample_time_ns)
        first.step()
    assert second.resume(0, first.answer(place, frame, "one", 0))
    width_or_stature = 3 if stated.shoulder_width_m else 0
    assert second.lengths([0])[0, width_or_stature] == first.lengths([0])[0, width_or_stature]
    np.testing.assert_allclose(second.lengths([0])[:, 1:3], first.lengths([0])[:, 1:3], atol=1e-9)
    go_on(frames, first, second)
    np.testing.assert_allclose(second.lengths([0])[:, 1:3], first.lengths([0])[:, 1:3], rtol=0.08)
