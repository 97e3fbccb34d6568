"""From one form into another: nothing is lost that the other form can hold."""

from __future__ import annotations

from pathlib import Path

import people
import pytest

from arm_ik_service.errors import SessionError
from arm_ik_service.io.convert import convert_session
from arm_ik_service.io.recording import RecordingWriter
from arm_ik_service.io.session import Session, open_session
from arm_ik_service.resources import resource_folder
from arm_ik_service.wire.messages import ControllerFrame, TrackedPose

LOSS = resource_folder("replay_logs") / "tracking_loss.mcap"


def frames_of(session: Session) -> list[tuple[str, ControllerFrame, int | None]]:
    return [(recorded.avatar, recorded.frame, recorded.receive_time_ns) for recorded in session.frames()]


def two_people(path: Path) -> Session:
    with RecordingWriter(path, {"place": "here"}) as writer:
        writer.write_calibration("ann", b'{"body":{"stature_m":1.6}}', 0)
        for seq in range(30):
            frame, answer = people.answer(seq)
            if seq == 20:
                writer.write_calibration("ann", b'{"body":{"stature_m":1.7}}', answer.publish_time_ns)
            writer.write_frame("ann", frame, answer.publish_time_ns - 5)
            writer.write_frame("bob", frame, answer.publish_time_ns - 4)
            writer.write_arms("ann", answer, answer.publish_time_ns + 5)
    return open_session(path)


def assert_same(before: TrackedPose | None, after: TrackedPose | None) -> None:
    assert (before is None) == (after is None)
    if before is not None and after is not None:
        assert after.position == before.position
        assert after.orientation == pytest.approx(before.orientation, abs=2e-6)  # unit again: six digits are not quite
        assert after.flags == before.flags
        assert (after.linear_velocity, after.angular_velocity) == (before.linear_velocity, before.angular_velocity)


def test_losses_flags_velocities_and_times_survive_the_way_to_arrays_and_back(tmp_path: Path) -> None:
    session = open_session(LOSS)
    assert convert_session(session, tmp_path / "a.npz") == session.frame_count
    assert convert_session(open_session(tmp_path / "a.npz"), tmp_path / "b.mcap") == session.frame_count
    for before, after in zip(session.frames(), open_session(tmp_path / "b.mcap").frames(), strict=True):
        assert (after.avatar, after.receive_time_ns) == (before.avatar, before.receive_time_ns)
        a, b = before.frame, after.frame
        assert (b.seq, b.sample_time_ns, b.publish_time_ns, b.space) == (
            a.seq,
            a.sample_time_ns,
            a.publish_time_ns,
            a.space,
        )
        for device in ("head", "left", "right"):
            assert_same(getattr(a, device), getattr(b, device))


def test_a_log_takes_answers_and_profiles_along(tmp_path: Path) -> None:
    session = two_people(tmp_path / "a.mcap")
    assert convert_session(session, tmp_path / "b.mcap") == 60
    copy = open_session(tmp_path / "b.mcap")
    assert frames_of(copy) == frames_of(session)
    assert list(copy.arms()) == list(session.arms())
    before, after = ([*each.calibrations("ann")] for each in (session, copy))
    assert [profile.json for profile in after] == [profile.json for profile in before]
    assert after[1].time_ns == before[1].time_ns
    assert after[0].time_ns == next(copy.frames()).receive_time_ns
    assert copy.metadata["place"] == "here"
    assert copy.metadata["source"] == "a.mcap"
    assert copy.duration_s is not None
    assert copy.duration_s < 1.0, "the profile is logged where the frames begin"


def test_one_person_can_be_taken_out(tmp_path: Path) -> None:
    session = two_people(tmp_path / "a.mcap")
    assert convert_session(session, tmp_path / "bob.npz", avatar="bob") == 30
    assert open_session(tmp_path / "bob.npz").avatars == ("bob",)
    assert convert_session(session, tmp_path / "bob.mcap", avatar="bob") == 30
    bob = open_session(tmp_path / "bob.mcap")
    assert bob.avatars == ("bob",)
    assert list(bob.arms()) == []


@pytest.mark.parametrize(
    ("output", "avatar", "complaint"),
    [
        ("b.npz", None, "ann, bob"),
        ("b.mcap", "carol", "carol"),
        ("b.csv", None, "mcap or .npz"),
        ("a.mcap", None, "itself"),
    ],
)
def test_what_cannot_be_converted_is_refused_before_anything_is_written(
    tmp_path: Path, output: str, avatar: str | None, complaint: str
) -> None:
    session = two_people(tmp_path / "a.mcap")
    with pytest.raises(SessionError, match=complaint):
        convert_session(session, tmp_path / output, avatar=avatar)
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]
    assert session.frame_count == len(frames_of(session))


def test_progress_adds_up_to_the_frames(tmp_path: Path) -> None:
    session = open_session(LOSS)
    steps: list[int] = []
    convert_session(session, tmp_path / "a.npz", progress=steps.append)
    assert sum(steps) == session.frame_count
    assert len(steps) > 1


def test_a_real_replay_keeps_its_times_in_a_log(recordings: Path, tmp_path: Path) -> None:
    session = open_session(recordings / "vr" / "beatsaber_quest2_90hz.bsor")
    convert_session(session, tmp_path / "a.mcap")
    copy = open_session(tmp_path / "a.mcap")
    assert [frame for _, frame, _ in frames_of(copy)] == [frame for _, frame, _ in frames_of(session)]
    assert copy.metadata["modifiers"] == "FS"
