"""Beat Saber replays: built byte by byte from the format's description, and the real ones."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from arm_ik_service.errors import SessionError
from arm_ik_service.geometry import batch
from arm_ik_service.io.bsor import SABER_FROM_GRIP
from arm_ik_service.io.session import open_session
from arm_ik_service.wire.messages import FULLY_TRACKED, ORIENTATION_VALID, POSITION_VALID

Sample = tuple[
    float, tuple[float, ...], tuple[float, ...], tuple[float, ...]
]  # time [s], head, left, right in Unity axes

FORWARD = (0.0, 0.0, 0.0, 1.0)
HEAD = (0.0, 1.7, 0.0, *FORWARD)
FRAME_SIZE = 92
VR = ("quest1_72hz_tracking_loss", "vive_90hz", "quest2_90hz", "rifts_80hz_gap")


def string(text: str) -> bytes:
    return struct.pack("<i", len(text.encode())) + text.encode()


def replay(
    frames: Sequence[Sample],
    *,
    modifiers: str = "",
    height: float = 1.8,
    promised: int | None = None,
) -> bytes:
    """A whole replay; a frame is its time, and Unity poses of head, left and right saber."""
    head = struct.pack("<IB", 0x442D3D69, 1) + b"\x00"
    info = b"".join(string(f"s{i}") for i in range(13)) + struct.pack("<i", 77)
    info += (
        string("Standard") + string("Triangle") + string(modifiers) + struct.pack("<f?4f", 20.0, True, height, 0, 0, 0)
    )
    body = b"\x01" + struct.pack("<i", len(frames) if promised is None else promised)
    for time_s, *poses in frames:
        body += struct.pack("<fi", time_s, 90) + b"".join(struct.pack("<7f", *pose) for pose in poses)
    return head + info + body + b"\x02" + struct.pack("<i", 0)


def moving(count: int, rate_hz: float = 90.0) -> list[Sample]:
    return [
        (i / rate_hz, HEAD, (-0.3, 1.0 + 1e-3 * i, 0.4, *FORWARD), (0.3, 1.0 - 1e-3 * i, 0.4, *FORWARD))
        for i in range(count)
    ]


def write(folder: Path, data: bytes) -> Path:
    path = folder / "replay.bsor"
    path.write_bytes(data)
    return path


def test_a_unity_pose_becomes_the_openxr_pose_that_looks_the_same(tmp_path: Path) -> None:
    # 30 degrees to the right and then 20 degrees up, as a Unity yaw of +30 and pitch of -20
    yaw, pitch = math.radians(30.0), math.radians(-20.0)
    unity = batch.multiply(
        [0, math.sin(yaw / 2), 0, math.cos(yaw / 2)], [math.sin(pitch / 2), 0, 0, math.cos(pitch / 2)]
    )
    path = write(tmp_path, replay([(0.0, (0.1, 1.7, 0.2, *unity), HEAD, HEAD)]))
    (recorded,) = open_session(path).frames()
    head = recorded.frame.head
    assert head is not None
    assert head.position == pytest.approx((0.1, 1.7, -0.2), abs=1e-6)
    gaze = batch.rotate(head.orientation, [0.0, 0.0, -1.0])
    expected = (math.cos(-pitch) * math.sin(yaw), math.sin(-pitch), -math.cos(-pitch) * math.cos(yaw))
    assert gaze == pytest.approx(expected, abs=1e-6)
    assert batch.rotate(head.orientation, [1.0, 0.0, 0.0])[1] == pytest.approx(0.0, abs=1e-6)


def test_the_blade_leaves_the_fist_on_the_thumbs_side_tilted_forward(tmp_path: Path) -> None:
    path = write(tmp_path, replay([(0.0, HEAD, (-0.3, 1.0, 0.4, *FORWARD), (0.3, 1.0, 0.4, *FORWARD))]))
    (recorded,) = open_session(path).frames()
    for pose in (recorded.frame.left, recorded.frame.right):
        assert pose is not None
        thumb = batch.rotate(pose.orientation, [0.0, 0.0, -1.0])
        blade = np.array([0.0, 0.0, -1.0])
        assert math.degrees(math.acos(float(thumb @ blade))) == pytest.approx(45.0, abs=1e-3)
        assert thumb[1] > 0.5, "a person who points a saber ahead has the thumb up"
        assert batch.rotate(pose.orientation, [1.0, 0.0, 0.0])[0] == pytest.approx(1.0, abs=1e-6)
        behind = np.array(pose.position) @ -blade - (-0.4)
        assert behind == pytest.approx(SABER_FROM_GRIP[2], abs=1e-6)


@pytest.mark.parametrize(
    ("modifiers", "speed"), [("", 1.0), ("FS", 1.2), ("NF,SF", 1.5), ("SS, GN", 0.85), ("NOFS", 1.0)]
)
def test_song_time_is_divided_by_the_speed_modifier(tmp_path: Path, modifiers: str, speed: float) -> None:
    session = open_session(write(tmp_path, replay(moving(91), modifiers=modifiers)))
    *_, last = session.frames()
    assert last.frame.sample_time_ns == pytest.approx(1e9 / speed, rel=1e-6)
    assert session.duration_s == pytest.approx(1.0 / speed, rel=1e-6)


def test_what_is_no_pose_comes_without_flags_and_finite(tmp_path: Path) -> None:
    good = moving(6)
    zero, two = (0.0,) * 7, (0.1, 1.0, 0.2, 0.0, 0.0, 0.0, 2.0)
    bad = [
        zero,
        two,
        (math.nan, 1, 1, *FORWARD),
        (0, math.inf, 1, *FORWARD),
        (0, 0, 0, *FORWARD),
        (1, 1, 1, math.nan, 0, 0, 1),
    ]
    frames = [(good[i][0], good[i][1], bad[i], good[i][3]) for i in range(6)]
    for recorded in open_session(write(tmp_path, replay(frames))).frames():
        left, right = recorded.frame.left, recorded.frame.right
        assert left is not None
        assert right is not None
        assert left.flags == 0
        assert np.isfinite(left.position).all()
        assert np.linalg.norm(left.orientation) == pytest.approx(1.0)
        assert right.flags == FULLY_TRACKED


def test_a_saber_that_stands_exactly_still_for_long_is_not_tracked(tmp_path: Path) -> None:
    frames = moving(3000)
    parked = frames[1200][2]
    frames = [(t, head, parked if 1200 <= i < 2400 else left, right) for i, (t, head, left, right) in enumerate(frames)]
    flags = [
        recorded.frame.left.flags
        for recorded in open_session(write(tmp_path, replay(frames))).frames()
        if recorded.frame.left
    ]
    assert set(flags[:1200]) == {FULLY_TRACKED}
    assert set(flags[1200:1245]) == {FULLY_TRACKED}, "it may just be held still"
    assert set(flags[1247:2400]) == {ORIENTATION_VALID | POSITION_VALID}
    assert set(flags[2400:]) == {FULLY_TRACKED}


def test_what_the_file_says_about_itself_is_there(tmp_path: Path) -> None:
    metadata = open_session(write(tmp_path, replay(moving(2), modifiers="FS", height=1.83))).metadata
    assert metadata["stature_m"] == pytest.approx(1.83, abs=1e-6)
    assert metadata["left_handed"] is True
    assert metadata["modifiers"] == "FS"
    assert metadata["speed"] == 1.2
    assert metadata["headset"] == "s7"
    assert "stature_m" not in open_session(write(tmp_path, replay(moving(2), height=0.0))).metadata


def test_the_frames_before_a_cut_are_read_and_the_cut_is_named(tmp_path: Path) -> None:
    whole = replay(moving(50))
    cut = len(whole) - 5 - 10 * FRAME_SIZE - 7
    session = open_session(write(tmp_path, whole[:cut]))
    frames = list(session.frames())
    assert len(frames) == session.frame_count == 39
    assert [recorded.frame.seq for recorded in frames] == list(range(39))
    (warning,) = session.warnings
    assert "39 of 50" in warning
    assert str(cut) in warning


def test_every_cut_before_the_first_frame_is_one_error_with_an_offset(tmp_path: Path) -> None:
    whole = replay(moving(2))
    first_end = len(whole) - 5 - FRAME_SIZE
    for cut in range(1, first_end, 7):
        with pytest.raises(SessionError) as caught:
            open_session(write(tmp_path, whole[:cut]))
        assert caught.value.offset is not None
        assert caught.value.offset <= cut
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("count", [-1, 0, 2**31 - 1])
def test_a_count_of_frames_that_cannot_be_is_met_without_believing_it(tmp_path: Path, count: int) -> None:
    path = write(tmp_path, replay(moving(3), promised=count))
    if count > 0:
        assert open_session(path).frame_count == 3
    else:
        with pytest.raises(SessionError, match="frames"):
            open_session(path)


WHOLE = replay(moving(20), modifiers="FS")


@settings(max_examples=300)
@given(data=st.data())
def test_damaged_bytes_give_a_session_error_or_finite_frames_and_nothing_else(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    damaged = bytearray(WHOLE)
    for _ in range(data.draw(st.integers(1, 6))):
        at = data.draw(st.integers(4, len(damaged) - 1))
        damaged[at] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(5, len(damaged)))
    path = tmp_path_factory.getbasetemp() / "damaged.bsor"
    path.write_bytes(bytes(damaged[:cut]))
    try:
        frames = list(open_session(path).frames())
    except SessionError:
        return
    for recorded in frames:
        for pose in (recorded.frame.head, recorded.frame.left, recorded.frame.right):
            assert pose is not None
            assert np.isfinite([*pose.position, *pose.orientation]).all()
            assert np.linalg.norm(pose.orientation) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("name", VR)
def test_a_real_replay_gives_every_frame_with_few_that_are_not_tracked(recordings: Path, name: str) -> None:
    session = open_session(recordings / "vr" / f"beatsaber_{name}.bsor")
    frames = list(session.frames())
    assert len(frames) == session.frame_count
    assert len(frames) > 15_000
    assert not session.warnings
    times = np.array([recorded.frame.sample_time_ns for recorded in frames])
    assert (np.diff(times) >= 0).all()
    hands = [pose for recorded in frames for pose in (recorded.frame.left, recorded.frame.right) if pose is not None]
    assert np.isfinite([pose.position for pose in hands]).all()
    assert sum(pose.flags != FULLY_TRACKED for pose in hands) <= 2, "only the garbage of the first frame"
    for side in ("left", "right"):
        grips = np.array(
            [(*p.position, *p.orientation) for r in frames[1:] if (p := getattr(r.frame, side)) is not None]
        )
        necks = np.array([p.position for r in frames[1:] if (p := r.frame.head) is not None]) - [0.0, 0.15, 0.0]
        wrist_behind = batch.rotate(grips[:, 3:], [0.0, 0.075, 0.0])  # grip +Y points from the palm to the wrist
        nearer = np.linalg.norm(grips[:, :3] - necks, axis=1) - np.linalg.norm(
            grips[:, :3] + wrist_behind - necks, axis=1
        )
        assert nearer.mean() > 0.0, "a wrist lies between the hand and the body"
