"""The bundled recordings: made again they are the same, and what they show is a person."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from arm_ik_service.geometry import batch
from arm_ik_service.io.samples import ONLY_VALID
from arm_ik_service.io.session import RecordedFrame, open_session
from arm_ik_service.io.synthesis import SCENES, Scene
from arm_ik_service.io.synthesis.__main__ import main
from arm_ik_service.io.synthesis.motion import PEAK_SPEED, Movement, minimum_jerk
from arm_ik_service.io.synthesis.person import ARM_M, FOREARM_M, STATURE_M, UPPER_ARM_M, Poses, pose_person
from arm_ik_service.resources import resource_folder
from arm_ik_service.wire.messages import FULLY_TRACKED, SIDES, Side, TrackedPose

BUNDLED = resource_folder("replay_logs")
BY_NAME = {scene.name: scene for scene in SCENES}
every_scene = pytest.mark.parametrize("scene", SCENES, ids=list(BY_NAME))


def truth(scene: Scene) -> Poses:
    return pose_person(scene.perform(scene.time_s))


def numbers(recorded: RecordedFrame) -> list[float]:
    poses = [pose for pose in (recorded.frame.head, recorded.frame.left, recorded.frame.right) if pose is not None]
    return [x for pose in poses for x in (*pose.position, *pose.orientation)]


def speed(points: batch.Array, rate_hz: float) -> batch.Array:
    return np.asarray(np.linalg.norm(np.gradient(points, 1.0 / rate_hz, axis=0), axis=1))


@every_scene
def test_made_again_a_bundled_recording_is_the_same(scene: Scene) -> None:
    bundled = list(open_session(BUNDLED / f"{scene.name}.mcap").frames())
    again = list(scene.frames())
    assert len(again) == len(bundled)
    for old, new in zip(bundled, again, strict=True):
        a, b = old.frame, new.frame
        assert (b.seq, b.sample_time_ns, b.publish_time_ns) == (a.seq, a.sample_time_ns, a.publish_time_ns)
        assert new.receive_time_ns == old.receive_time_ns
        assert numbers(new) == pytest.approx(numbers(old), abs=2e-6)  # the last digit, on another machine
        for device in ("head", "left", "right"):
            assert getattr(getattr(a, device), "flags", None) == getattr(getattr(b, device), "flags", None)


def test_the_documented_command_writes_files_that_open(tmp_path: Path) -> None:
    assert main([str(tmp_path)]) == 0
    assert main([str(tmp_path / "nowhere")]) == 2
    for path in sorted(tmp_path.iterdir()):
        session = open_session(path)
        assert session.warnings == ()
        assert session.calibrations("demo")
        assert path.stat().st_size < 1_000_000


@every_scene
def test_a_recording_is_small_and_lasts_as_long_as_it_says(scene: Scene) -> None:
    path = BUNDLED / f"{scene.name}.mcap"
    assert path.stat().st_size < 1_000_000
    duration_s = open_session(path).duration_s
    assert duration_s == pytest.approx(scene.duration_s, abs=0.05)
    assert 10.0 <= scene.duration_s <= 20.0
    assert 72.0 <= scene.rate_hz <= 90.0


@every_scene
@pytest.mark.parametrize("side", SIDES)
def test_bones_keep_their_lengths_and_elbows_their_places(scene: Scene, side: Side) -> None:
    poses = truth(scene)
    shoulder, elbow, wrist = (getattr(poses, f"{side}_{joint}") for joint in ("shoulder", "elbow", "wrist"))
    assert np.linalg.norm(elbow - shoulder, axis=1) == pytest.approx(UPPER_ARM_M, abs=1e-9)
    assert np.linalg.norm(wrist - elbow, axis=1) == pytest.approx(FOREARM_M, abs=1e-9)
    reach = np.linalg.norm(wrist - shoulder, axis=1) / ARM_M
    assert reach.min() > 0.3
    assert reach.max() < 0.986
    assert speed(elbow, scene.rate_hz).max() < 6.5, "an elbow that flips is faster"


@every_scene
@pytest.mark.parametrize("side", SIDES)
def test_hands_never_enter_the_head_or_the_floor(scene: Scene, side: Side) -> None:
    poses = truth(scene)
    skull = poses.head[:, :3] + batch.rotate(poses.head[:, 3:], [0.0, 0.0, 0.09])
    assert np.linalg.norm(getattr(poses, side)[:, :3] - skull, axis=1).min() > 0.10
    assert getattr(poses, side)[:, 1].min() > 0.5


@every_scene
def test_the_head_is_where_the_eyes_of_such_a_person_are_and_upright(scene: Scene) -> None:
    head = truth(scene).head
    assert np.abs(head[:, 1] - 0.936 * STATURE_M).max() < 0.2
    assert batch.rotate(head[:, 3:], [0.0, 1.0, 0.0])[:, 1].min() > 0.75
    assert speed(head[:, :3], scene.rate_hz).max() < 2.0


def test_fists_reach_the_speed_of_punches() -> None:
    scene = BY_NAME["boxing"]
    fastest = [speed(getattr(truth(scene), side)[:, :3], scene.rate_hz).max() for side in SIDES]
    assert min(fastest) > 4.8
    assert max(fastest) < 7.5


def test_a_hand_hanging_at_ease_has_the_thumb_forward_and_the_palm_to_the_thigh() -> None:
    poses = truth(BY_NAME["reach_and_grab"])
    for side, inwards in (("left", 1.0), ("right", -1.0)):
        grip = getattr(poses, side)[10, 3:]
        thumb = batch.rotate(grip, [0.0, 0.0, -1.0])
        palm = batch.rotate(grip, [1.0 if side == "left" else -1.0, 0.0, 0.0])
        assert thumb[2] < -0.3
        assert palm[0] * inwards > 0.3


def test_the_noise_is_a_fraction_of_a_millimetre_and_of_a_degree() -> None:
    scene = BY_NAME["reach_and_grab"]
    poses, frames = truth(scene), list(scene.frames())
    for device in ("head", "left", "right"):
        sensed = [getattr(recorded.frame, device) for recorded in frames]
        error = np.array([pose.position for pose in sensed]) - getattr(poses, device)[:, :3]
        turned = batch.angle_between([pose.orientation for pose in sensed], getattr(poses, device)[:, 3:])
        assert 1e-4 < error.std() < 6e-4
        assert 0.05 < np.degrees(np.sqrt(np.mean(turned**2))) < 0.3
        assert all(pose.flags == FULLY_TRACKED for pose in sensed)


def test_each_loss_is_what_its_kind_says() -> None:
    scene = BY_NAME["tracking_loss"]
    flags_of = {"inferred": ONLY_VALID, "held": ONLY_VALID | 4, "lost": 0}
    by_seq = {recorded.frame.seq: recorded.frame for recorded in scene.frames()}
    kinds = set()
    for loss in scene.losses:
        kinds.add(loss.kind)
        begin, end = (int(np.ceil(second * scene.rate_hz - 1e-9)) for second in (loss.begin_s, loss.end_s))
        during: list[TrackedPose | None] = [
            getattr(by_seq[seq], loss.hand) for seq in range(begin, end) if seq in by_seq
        ]
        if loss.kind == "absent":
            assert set(during) == {None}
            continue
        assert {pose.flags for pose in during if pose is not None} == {flags_of[loss.kind]}
        if loss.kind in ("held", "lost"):
            assert len({pose.position for pose in during if pose is not None}) == 1
    assert kinds == {"inferred", "held", "lost", "absent"}


def test_a_stroke_starts_and_ends_at_rest_and_is_fastest_half_way() -> None:
    phase = np.linspace(-0.2, 1.2, 2801)
    way = minimum_jerk(phase)
    rate = np.gradient(way, phase)
    assert way[0] == 0.0
    assert way[-1] == 1.0
    assert (np.diff(way) >= 0.0).all()
    assert rate.max() == pytest.approx(PEAK_SPEED, abs=1e-4)
    assert phase[rate.argmax()] == pytest.approx(0.5, abs=1e-3)
    assert np.gradient(rate, phase)[np.abs(phase) < 1e-9] == pytest.approx(0.0, abs=0.05)


def test_overlapping_strokes_end_at_the_last_target() -> None:
    movement = (
        Movement((0.0, 1.0)).stroke(0.0, 1.0, (2.0, 0.0)).stroke(0.4, 1.0, (-1.0, 5.0)).stroke(1.0, 0.2, (3.0, 3.0))
    )
    assert movement.at(np.array([-1.0])).tolist() == [[0.0, 1.0]]
    assert movement.at(np.array([1.5]))[0] == pytest.approx([3.0, 3.0], abs=1e-12)
