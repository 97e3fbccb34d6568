"""MCAP recordings: what goes in comes out, other tools read them, and a kill loses a second at most."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
from pathlib import Path

import msgspec
import numpy as np
import people
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import CompressionType, IndexType, Writer

from arm_ik_service.errors import SessionError
from arm_ik_service.io.recording import Recording, RecordingWriter
from arm_ik_service.io.session import answered_frames, open_session
from arm_ik_service.wire.keys import Keys
from arm_ik_service.wire.messages import (
    FULLY_TRACKED,
    ORIENTATION_TRACKED,
    ORIENTATION_VALID,
    VERSION,
    ArmsState,
    ControllerFrame,
    TrackedPose,
)

SECOND = 1_000_000_000


def frame(seq: int, *, time_ns: int | None = None) -> ControllerFrame:
    hand = TrackedPose((0.1, 1.0 + 0.001 * seq, -1 / 3), (0.0, 0.0, 0.6, 0.8), linear_velocity=(0.0, 0.09, 0.0))
    time = seq * SECOND // 90 if time_ns is None else time_ns
    return ControllerFrame(VERSION, seq, time, time + 5, "stage", hand, None, hand)


def answer(avatar: str, seq: int) -> ArmsState:
    time = frame(seq).sample_time_ns
    _, state = people.answer(seq, avatar=avatar)
    return msgspec.structs.replace(
        state, sample_time_ns=time, receive_time_ns=time + 1000 + seq, publish_time_ns=time + 20_000
    )


def recording(path: Path, count: int = 400, avatars: tuple[str, ...] = ("anna",)) -> Path:
    with RecordingWriter(path, {"place": "here"}) as writer:
        for seq in range(count):
            for avatar in avatars:
                writer.write_frame(avatar, frame(seq), frame(seq).sample_time_ns + 700)
    return path


def opened(path: Path) -> Recording:
    session = open_session(path)
    assert isinstance(session, Recording)
    return session


def test_frames_come_back_as_they_were_with_the_times_they_were_received(tmp_path: Path) -> None:
    session = opened(recording(tmp_path / "a.mcap"))
    frames = list(session.frames())
    assert [recorded.frame for recorded in frames] == [frame(seq) for seq in range(400)]
    assert [recorded.receive_time_ns for recorded in frames] == [frame(seq).sample_time_ns + 700 for seq in range(400)]
    assert session.frame_count == 400
    assert session.avatars == ("anna",)
    assert session.duration_s == pytest.approx(399 / 90)
    assert session.metadata["place"] == "here"
    assert session.warnings == ()


def test_answers_skeletons_and_profiles_lie_beside_the_frames(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path / "a.mcap", keys=Keys("lab3")) as writer:
        writer.write_skeleton("anna", msgspec.msgpack.encode(people.SKELETON), 0)
        writer.write_calibration("anna", b'{"body":{"stature_m":1.6}}', 1)
        writer.write_calibration("anna", msgspec.msgpack.encode({"body": {"stature_m": 1.7}}), 2)
        for seq in range(20):
            writer.write_frame("anna", frame(seq), frame(seq).sample_time_ns)
            writer.write_arms("anna", answer("anna", seq), frame(seq).sample_time_ns + 30_000)
    session = opened(tmp_path / "a.mcap")
    assert list(session.arms()) == [answer("anna", seq) for seq in range(20)]
    assert session.answer_count == 20
    assert session.skeleton("anna") == people.SKELETON
    logged = [(profile.time_ns, json.loads(profile.json)) for profile in session.calibrations("anna")]
    assert logged == [(1, {"body": {"stature_m": 1.6}}), (2, {"body": {"stature_m": 1.7}})]
    assert session.calibrations("bert") == ()
    assert session.skeleton("bert") is None


def test_answers_come_with_the_frames_they_answer_at_the_times_the_service_stamped(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path / "a.mcap") as writer:
        for seq in range(30):
            if seq % 5 != 3:  # an answer may even be logged before its frame
                writer.write_arms("anna", answer("anna", seq), frame(seq).sample_time_ns)
            if seq != 7:
                writer.write_frame("anna", frame(seq), frame(seq).sample_time_ns + 10)
            writer.write_frame("bert", frame(seq), frame(seq).sample_time_ns + 10)
    pairs = list(answered_frames(open_session(tmp_path / "a.mcap")))
    assert [arms.seq for _, arms in pairs] == [seq for seq in range(30) if seq % 5 != 3]
    assert [arms.seq for recorded, arms in pairs if recorded is None] == [7]
    for recorded, arms in pairs:
        if recorded is not None:
            assert (recorded.avatar, recorded.frame) == ("anna", frame(arms.seq))
            assert recorded.receive_time_ns == answer("anna", arms.seq).receive_time_ns


def test_a_recording_of_the_same_motion_played_twice_has_every_answer_with_its_own_frame(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path / "a.mcap") as writer:
        for turn in range(2):
            for seq in range(20):
                late = msgspec.structs.replace(answer("anna", seq), receive_time_ns=turn * SECOND + seq)
                writer.write_frame("anna", frame(seq), turn * SECOND + 2 * seq)
                writer.write_arms("anna", late, turn * SECOND + 2 * seq + 1)
    pairs = list(answered_frames(open_session(tmp_path / "a.mcap")))
    received = [recorded.receive_time_ns for recorded, _ in pairs if recorded is not None]
    assert received == [turn * SECOND + seq for turn in range(2) for seq in range(20)]


def test_messages_come_by_the_time_of_the_log_not_in_the_order_of_the_file(tmp_path: Path) -> None:
    order = np.random.default_rng(5).permutation(900)
    with RecordingWriter(tmp_path / "a.mcap") as writer:
        for i, seq in enumerate(order.tolist()):
            writer.write_frame("anna", frame(seq), seq // 2 * SECOND // 45)
            if i % 50 == 0:
                writer.flush()
    times = [recorded.receive_time_ns for recorded in open_session(tmp_path / "a.mcap").frames()]
    assert len(times) == 900
    assert times == sorted(times, key=lambda time: time or 0)


def test_the_official_reader_finds_messages_and_schemas_that_fit(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", 200, ("anna", "bert"))
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == 400
        assert summary.statistics.chunk_count >= 2
        found = 0
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            assert (schema.name, schema.encoding) == ("arm_ik.ControllerFrame", "jsonschema")
            assert channel.message_encoding == "json"
            assert channel.topic in {"avatar/anna/controllers", "avatar/bert/controllers"}
            content = json.loads(message.data)
            assert message.sequence == content["seq"]
            assert message.publish_time == content["publish_time_ns"]
            found += 1
        assert found == 400
        properties = json.loads(next(iter(summary.schemas.values())).data)["$defs"]["ControllerFrame"]["properties"]
        assert set(properties) == set(content)


def test_numbers_that_json_has_not_are_recorded_as_poses_that_nobody_can_believe(tmp_path: Path) -> None:
    nowhere = TrackedPose((math.nan, 1.0, 2.0), (0.0, 0.0, 0.0, 1.0), linear_velocity=(math.inf, 0.0, 0.0))
    turned = TrackedPose((0.0, 1.0, 2.0), (math.nan, 0.0, 0.0, 1.0), angular_velocity=(0.0, 1.0, 0.0))
    with RecordingWriter(tmp_path / "a.mcap") as writer:
        writer.write_frame("anna", ControllerFrame(VERSION, 0, 0, 0, "stage", None, nowhere, turned), 0)
    session = open_session(tmp_path / "a.mcap")
    (recorded,) = session.frames()
    left, right = recorded.frame.left, recorded.frame.right
    assert left is not None
    assert right is not None
    assert left.flags == ORIENTATION_VALID | ORIENTATION_TRACKED
    assert left.linear_velocity is None
    assert right.flags == FULLY_TRACKED & ~(ORIENTATION_VALID | ORIENTATION_TRACKED)
    assert right.angular_velocity == (0.0, 1.0, 0.0)
    assert session.warnings == ()


def test_a_log_cut_anywhere_gives_the_frames_before_the_cut(tmp_path: Path) -> None:
    data = recording(tmp_path / "a.mcap", 900).read_bytes()
    cut_path = tmp_path / "cut.mcap"
    counts = []
    for cut in np.linspace(len(data) // 5, len(data) - 1, 60).astype(int).tolist():
        cut_path.write_bytes(data[:cut])
        session = opened(cut_path)
        frames = [recorded.frame for recorded in session.frames()]
        assert frames == [frame(seq) for seq in range(len(frames))]
        assert len(frames) == session.frame_count
        if len(frames) < 900:
            assert any("byte" in warning and str(len(frames)) in warning for warning in session.warnings)
        counts.append(len(frames))
    assert counts == sorted(counts)
    assert counts[0] >= 900 // 5 - 100
    assert counts[-1] == 900, "only the index was cut off"


def test_a_damaged_chunk_costs_its_own_messages_only(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", 900)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)
    session = open_session(path)
    seqs = [recorded.frame.seq for recorded in session.frames()]
    assert 700 < len(seqs) < 900
    assert seqs == sorted(seqs)
    assert seqs[-1] == 899
    assert any("damaged" in warning for warning in session.warnings)


def test_a_message_of_another_shape_is_left_out_and_counted(tmp_path: Path) -> None:
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("x", "jsonschema", b"{}")
        channel = writer.register_channel("avatar/anna/controllers", "json", schema)
        bodies = [b"{}", b"\xff\x00", msgspec.json.encode(frame(1)), msgspec.json.encode({"version": 999})]
        for i, body in enumerate(bodies):
            writer.add_message(channel, i, body, i)
        writer.finish()
    session = open_session(path)
    assert [recorded.frame.seq for recorded in session.frames()] == [1]
    (warning,) = session.warnings
    assert "3 messages on avatar/anna/controllers" in warning
    assert list(session.frames())
    assert session.warnings == (warning,), "reading again counts anew"


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD])
@pytest.mark.parametrize("index", [IndexType.ALL, IndexType.NONE])
@pytest.mark.parametrize("chunked", [True, False])
def test_what_other_writers_do_differently_does_not_matter(
    tmp_path: Path, compression: CompressionType, index: IndexType, chunked: bool
) -> None:
    path = tmp_path / "other.mcap"
    with path.open("wb") as file:
        writer = Writer(file, 4096, compression, index, use_chunking=chunked, repeat_channels=chunked)
        writer.start()
        schema = writer.register_schema("x", "jsonschema", b"{}")
        writer.register_channel("camera/0/image", "raw", schema)
        channel = writer.register_channel("hall/2/avatar/anna/controllers", "json", schema)
        for seq in range(100):
            writer.add_message(channel, seq, msgspec.json.encode(frame(seq)), seq)
            writer.add_message(channel - 1, seq, b"\x00" * 50, seq)
        writer.finish()
    session = open_session(path)
    assert session.frame_count == 100
    assert [recorded.frame.seq for recorded in session.frames()] == list(range(100))


def test_a_log_without_frames_is_refused_with_what_it_has(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path / "a.mcap") as writer:
        writer.write_calibration("anna", b"{}", 0)
    with pytest.raises(SessionError, match="avatar/anna/calibration"):
        open_session(tmp_path / "a.mcap")


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(SessionError, match="cannot be written"):
        RecordingWriter(tmp_path / "no such folder" / "a.mcap")


def test_a_full_disk_is_a_session_error(tmp_path: Path) -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("needs /dev/full, which only Linux has")
    with pytest.raises(SessionError, match="No space left"):
        RecordingWriter(full)


KILLED = """
import sys
from pathlib import Path
sys.path[:0] = sys.argv[2:]
from test_recording import SECOND, frame
from arm_ik_service.io.recording import RecordingWriter
writer = RecordingWriter(Path(sys.argv[1]))
seq = 0
while True:
    writer.write_frame("anna", frame(seq), frame(seq).sample_time_ns)
    seq += 1
    if seq % 90 == 1:
        print(seq, flush=True)
"""


def test_a_recorder_killed_while_it_writes_has_lost_a_second_at_most(tmp_path: Path) -> None:
    path = tmp_path / "killed.mcap"
    command = [sys.executable, "-c", KILLED, str(path), str(Path(__file__).parent), str(Path(__file__).parents[1])]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        written = 0
        for line in process.stdout:
            written = int(line)
            if written > 3000:
                os.kill(process.pid, signal.SIGKILL)
                break
    session = opened(path)
    frames = [recorded.frame for recorded in session.frames()]
    assert len(frames) >= written - 91
    assert frames == [frame(seq) for seq in range(len(frames))]
    assert any("without having been closed" in warning for warning in session.warnings)


def test_a_log_that_is_still_being_written_can_be_read_up_to_its_last_flush(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path / "a.mcap") as writer:
        for seq in range(50):
            writer.write_frame("anna", frame(seq), frame(seq).sample_time_ns)
        writer.flush()
        writer.write_frame("anna", frame(50), frame(50).sample_time_ns)
        assert len(list(open_session(tmp_path / "a.mcap").frames())) == 50
    with (tmp_path / "a.mcap").open("rb") as file:
        assert sum(1 for _ in NonSeekingReader(file).iter_messages()) == 51


@settings(max_examples=200)
@given(data=st.data())
def test_damaged_logs_give_a_session_error_or_frames_and_nothing_else(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    folder = tmp_path_factory.getbasetemp()
    if not (folder / "whole.mcap").exists():
        recording(folder / "whole.mcap", 120)
    damaged = bytearray((folder / "whole.mcap").read_bytes())
    for _ in range(data.draw(st.integers(1, 5))):
        damaged[data.draw(st.integers(8, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    (folder / "damaged.mcap").write_bytes(damaged)
    try:
        session = open_session(folder / "damaged.mcap")
        seqs = [recorded.frame.seq for recorded in session.frames()]
    except SessionError:
        return
    assert set(seqs) <= set(range(120))
