"""Sessions and solutions as arrays: the documented columns, whatever an archive holds, and the real recordings."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from arm_ik_service.errors import SessionError
from arm_ik_service.io.columns import BLOCK
from arm_ik_service.io.npz import NpzSessionWriter
from arm_ik_service.io.session import RecordedFrame, open_session
from arm_ik_service.wire.messages import (
    FULLY_TRACKED,
    ORIENTATION_TRACKED,
    ORIENTATION_VALID,
    POSITION_TRACKED,
    POSITION_VALID,
    VERSION,
    ControllerFrame,
    TrackedPose,
)

COUNT = 40


def arrays(count: int = COUNT) -> dict[str, Any]:
    random = np.random.default_rng(3)
    poses = np.concatenate([random.normal(size=(3, count, 3)), random.normal(size=(3, count, 4))], axis=2)
    poses[..., 3:] /= np.linalg.norm(poses[..., 3:], axis=2, keepdims=True)
    return {"t": np.arange(count) / 120.0, "head": poses[0], "left": poses[1], "right": poses[2]}


def frames_of(folder: Path, columns: dict[str, Any]) -> list[RecordedFrame]:
    path = folder / "session.npz"
    np.savez(path, **columns)
    session = open_session(path)
    frames = list(session.frames())
    assert len(frames) == session.frame_count
    return frames


def pose_of(pose: TrackedPose | None) -> tuple[float, ...]:
    assert pose is not None
    return (*pose.position, *pose.orientation)


def test_poses_and_times_come_through_unchanged(tmp_path: Path) -> None:
    columns = arrays()
    for i, recorded in enumerate(frames_of(tmp_path, columns)):
        frame = recorded.frame
        assert frame.seq == i
        assert frame.sample_time_ns == round(columns["t"][i] * 1e9)
        assert recorded.receive_time_ns is None
        for device in ("head", "left", "right"):
            assert pose_of(getattr(frame, device)) == pytest.approx(tuple(columns[device][i]), abs=1e-12)
            assert getattr(frame, device).flags == FULLY_TRACKED


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("order", ["C", "F"])
def test_every_way_of_saving_an_array_gives_the_same_poses(tmp_path: Path, save: Any, dtype: Any, order: Any) -> None:
    columns = arrays(BLOCK + 7)
    stored = {k: np.asarray(v, dtype if k != "t" else np.float64, order=order) for k, v in columns.items()}
    save(tmp_path / "a.npz", **stored)
    frames = list(open_session(tmp_path / "a.npz").frames())
    assert [pose_of(r.frame.right) for r in frames] == pytest.approx(columns["right"], abs=1e-6)


def test_a_device_that_is_not_valid_is_absent(tmp_path: Path) -> None:
    columns = arrays() | {"left_valid": np.arange(COUNT) % 3 != 0, "right_valid": np.ones(COUNT)}
    for i, recorded in enumerate(frames_of(tmp_path, columns)):
        assert (recorded.frame.left is None) == (i % 3 == 0)
        assert recorded.frame.right is not None


def test_a_file_without_a_hand_has_that_hand_absent_throughout(tmp_path: Path) -> None:
    columns = arrays()
    del columns["left"]
    assert all(r.frame.left is None and r.frame.right is not None for r in frames_of(tmp_path, columns))


def test_half_a_pose_keeps_the_flags_of_the_half_that_is_one(tmp_path: Path) -> None:
    columns = arrays()
    columns["left"][0, :3] = np.nan
    columns["left"][1, 3:] = 0.0
    columns["left"][2, 3] = np.inf
    columns["left"][3, 3:] *= 1.004  # rounded to a few digits, as browsers do
    flags = [r.frame.left.flags for r in frames_of(tmp_path, columns)[:4] if r.frame.left]
    rotation, position = ORIENTATION_VALID | ORIENTATION_TRACKED, POSITION_VALID | POSITION_TRACKED
    assert flags == [rotation, position, position, FULLY_TRACKED]


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"t": None}, "no session"),
        (
            {"t": np.zeros(0), "head": np.zeros((0, 7)), "left": np.zeros((0, 7)), "right": np.zeros((0, 7))},
            "no frames",
        ),
        ({"left": np.zeros((COUNT, 6))}, "`left` has the shape"),
        ({"right": np.zeros((COUNT - 1, 7))}, "`right` has the shape"),
        ({"head": np.zeros(7)}, "`head` has the shape"),
        ({"t": np.array(["a"] * COUNT)}, "`t` has the shape"),
        ({"left": np.zeros((COUNT, 7), complex)}, "not numbers"),
        ({"left": np.array([[None] * 7] * COUNT)}, "not numbers"),
        ({"avatar": np.array("../../etc")}, "avatar"),
        ({"space": np.array("orbit")}, "space"),
        ({"seq": np.linspace(0, 1, COUNT)}, "no integers"),
    ],
)
def test_an_archive_that_is_no_session_is_one_line_that_says_why(
    tmp_path: Path, change: dict[str, Any], complaint: str
) -> None:
    columns = {k: v for k, v in (arrays() | change).items() if v is not None}
    with pytest.raises(SessionError, match=complaint) as caught:
        frames_of(tmp_path, columns)
    assert "\n" not in str(caught.value)
    assert "session.npz" in str(caught.value)


def test_a_header_that_claims_more_than_the_file_holds_allocates_nothing(tmp_path: Path) -> None:
    path = tmp_path / "huge.npz"
    with zipfile.ZipFile(path, "w") as archive:
        for name, shape in (("t", (10**12,)), ("head", (10**12, 7))):
            with archive.open(f"{name}.npy", "w") as file:
                header = {"descr": "<f8", "fortran_order": False, "shape": shape}
                np.lib.format.write_array_header_1_0(file, header)
    with pytest.raises(SessionError, match="claims the shape"):
        open_session(path)


def test_an_archive_that_was_cut_off_says_so(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", **arrays())
    data = (tmp_path / "a.npz").read_bytes()
    for cut in range(8, len(data), len(data) // 20):
        (tmp_path / "cut.npz").write_bytes(data[:cut])
        with pytest.raises(SessionError, match=r"cut\.npz"):
            list(open_session(tmp_path / "cut.npz").frames())


@settings(max_examples=200)
@given(data=st.data())
def test_damaged_archives_give_a_session_error_or_finite_frames_and_nothing_else(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    folder = tmp_path_factory.getbasetemp()
    if not (folder / "whole.npz").exists():
        np.savez_compressed(folder / "whole.npz", **arrays(4))
    damaged = bytearray((folder / "whole.npz").read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        damaged[data.draw(st.integers(4, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    (folder / "damaged.npz").write_bytes(damaged)
    try:
        frames = list(open_session(folder / "damaged.npz").frames())
    except SessionError:
        return
    poses = [pose for r in frames for pose in (r.frame.head, r.frame.left, r.frame.right) if pose is not None]
    assert np.isfinite([pose_of(pose) for pose in poses]).all()


numbers = st.floats(-50.0, 50.0)
vectors = st.tuples(numbers, numbers, numbers)
unit = st.tuples(numbers, numbers, numbers, st.floats(0.1, 1.0)).map(
    lambda q: tuple(float(x) for x in np.array(q) / np.linalg.norm(q))
)
poses = st.none() | st.builds(TrackedPose, vectors, unit, st.integers(0, 15), st.none() | vectors, st.none() | vectors)
times = st.integers(-(2**60), 2**60)
frames = st.builds(
    lambda seq, sample, publish, receive, head, left, right: RecordedFrame(
        "anna", ControllerFrame(VERSION, seq, sample, publish, "local_floor", head, left, right), receive
    ),
    *(st.integers(0, 2**62), times, times, times, poses, poses, poses),
)


@given(recorded=st.lists(frames, min_size=1, max_size=6))
def test_what_we_write_comes_back_as_it_was(
    tmp_path_factory: pytest.TempPathFactory, recorded: list[RecordedFrame]
) -> None:
    path = tmp_path_factory.getbasetemp() / "written.npz"
    writer = NpzSessionWriter("anna")
    for one in recorded:
        writer.write(one)
    writer.save(path)
    back = list(open_session(path).frames())
    assert len(back) == len(recorded)
    for before, after in zip(recorded, back, strict=True):
        assert (after.avatar, after.receive_time_ns) == ("anna", before.receive_time_ns)
        a, b = before.frame, after.frame
        assert (a.seq, a.sample_time_ns, a.publish_time_ns, a.space) == (
            b.seq,
            b.sample_time_ns,
            b.publish_time_ns,
            b.space,
        )
        for old, new in zip((a.head, a.left, a.right), (b.head, b.left, b.right), strict=True):
            assert (old is None) == (new is None)
            if old is not None and new is not None:
                assert new.flags == old.flags
                assert new.position == old.position
                assert new.orientation == pytest.approx(old.orientation, abs=1e-15)
                assert (new.linear_velocity, new.angular_velocity) == (old.linear_velocity, old.angular_velocity)


def test_a_file_is_there_whole_or_not_at_all(tmp_path: Path) -> None:
    writer = NpzSessionWriter("anna")
    with pytest.raises(SessionError, match="cannot be written"):
        writer.save(tmp_path / "no such folder" / "a.npz")
    assert list(tmp_path.iterdir()) == []


def test_every_real_session_gives_as_many_frames_as_it_has_rows(recordings: Path) -> None:
    paths = sorted(recordings.glob("*/*.npz"))
    assert len(paths) >= 17
    for path in paths:
        rows = np.load(path)
        frames = list(open_session(path).frames())
        assert len(frames) == len(rows["t"]), path
        last = frames[-1].frame
        assert last.sample_time_ns == pytest.approx(rows["t"][-1] * 1e9, abs=1)
        if "left_valid" not in rows.files or rows["left_valid"][-1]:
            assert pose_of(last.left) == pytest.approx(rows["left"][-1], abs=2e-3)  # some are rounded, so not unit
