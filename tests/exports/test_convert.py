"""`arm-ik convert` to other people's files: the recorded answers, or solved ones where there are none."""

from __future__ import annotations

import os
import subprocess
import sys
import tracemalloc
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import bvhio
import msgspec
import pyarrow.parquet
import pytest
from harness import COMMAND
from mcap.reader import make_reader
from postures import HANGING, RAISED, frame_of, motion, person
from typer.testing import CliRunner

from arm_ik_service.body.profile import Profile
from arm_ik_service.cli import app
from arm_ik_service.errors import SessionError, SettingsError
from arm_ik_service.exports.dialects import McapDialect
from arm_ik_service.io.recording import RecordingWriter
from arm_ik_service.io.session import RecordedFrame, RecordedProfile, Session, open_session
from arm_ik_service.programs.demo import bundled_session
from arm_ik_service.programs.export_session import export_session
from arm_ik_service.programs.offline import solve_frames
from arm_ik_service.settings import Settings
from arm_ik_service.wire.messages import ArmsState


def recorded(path: Path, states: list[ArmsState], *, answers: bool = True) -> Session:
    with RecordingWriter(path) as writer:
        for state in states:
            writer.write_frame(state.avatar, frame_of(state), state.receive_time_ns)
            if answers:
                writer.write_arms(state.avatar, state, state.publish_time_ns)
    return open_session(path)


def test_recorded_answers_are_converted_as_they_are(tmp_path: Path) -> None:
    states = motion(50)
    session = recorded(tmp_path / "session.mcap", states)
    assert export_session(session, tmp_path / "arms.parquet") == 50
    table = pyarrow.parquet.read_table(tmp_path / "arms.parquet")
    assert table["right_elbow_flexion_rad"].to_pylist() == [s.right.angles.elbow_flexion for s in states]
    assert not (tmp_path / "arms.part.parquet").exists()


def test_a_session_without_answers_is_solved(tmp_path: Path) -> None:
    session = open_session(bundled_session("reach_and_grab"))
    shown: list[int] = []
    count = export_session(session, tmp_path / "arms.bvh", progress=shown.append)
    assert count == sum(shown) == session.frame_count
    root = bvhio.readAsBvh(str(tmp_path / "arms.bvh"), loadKeyFrames=False)
    assert abs(root.FrameCount - count) <= 2


@pytest.mark.parametrize("dialect", list(McapDialect))
def test_every_mcap_dialect_is_a_whole_file_with_an_index(tmp_path: Path, dialect: McapDialect) -> None:
    session = recorded(tmp_path / "session.mcap", motion(20))
    export_session(session, tmp_path / "out.mcap", dialect=dialect)
    with (tmp_path / "out.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count >= 20
    assert summary.chunk_indexes


def test_the_mirror_is_in_the_file(tmp_path: Path) -> None:
    session = recorded(tmp_path / "session.mcap", [person(HANGING, RAISED)])
    export_session(session, tmp_path / "arms.parquet", mirror=True)
    row = pyarrow.parquet.read_table(tmp_path / "arms.parquet").to_pylist()[0]
    assert row["left_hand_y_m"] > 1.8
    assert row["left_hand_x_m"] < -0.1


def test_bvh_of_several_people_asks_which_one(tmp_path: Path) -> None:
    session = recorded(tmp_path / "two.mcap", [person(avatar="ann"), person(HANGING, RAISED, avatar="bob")])
    with pytest.raises(SessionError, match="ann, bob"):
        export_session(session, tmp_path / "arms.bvh")
    assert export_session(session, tmp_path / "arms.bvh", avatar="bob") == 1
    assert export_session(session, tmp_path / "arms.csv") == 2


def test_what_cannot_be_done_is_said_and_leaves_no_file(tmp_path: Path) -> None:
    session = recorded(tmp_path / "session.mcap", [person()])
    with pytest.raises(SettingsError, match="dialect"):
        export_session(session, tmp_path / "arms.bvh", dialect=McapDialect.ROS2)
    with pytest.raises(SettingsError, match="fps"):
        export_session(session, tmp_path / "arms.csv", fps=30.0)
    with pytest.raises(SessionError, match="nobody"):
        export_session(session, tmp_path / "arms.csv", avatar="nobody")
    with pytest.raises(SessionError, match="written"):
        export_session(session, tmp_path / "nowhere" / "arms.bvh")
    assert [path.name for path in tmp_path.iterdir()] == ["session.mcap"]


def test_the_command_line_keeps_session_options_and_arm_options_apart(tmp_path: Path) -> None:
    recorded(tmp_path / "session.mcap", motion(5))
    run = CliRunner().invoke
    session, npz, bvh = (str(tmp_path / name) for name in ("session.mcap", "again.npz", "arms.bvh"))
    assert run(app, ["convert", session, npz]).exit_code == 0
    assert run(app, ["convert", session, bvh, "--fps", "45"]).exit_code == 0
    wrong = run(app, ["convert", session, npz, "--overwrite", "--mirror"])
    assert isinstance(wrong.exception, SettingsError)
    again = run(app, ["convert", session, bvh])
    assert isinstance(again.exception, SessionError)
    assert "--overwrite" in str(again.exception)


class Looped:
    """An endless session's answers: the same few states at ever later times."""

    warnings: tuple[str, ...] = ()
    metadata: dict[str, str | float | bool] = {}  # noqa: RUF012
    avatars: tuple[str, ...] = ("ann",)
    path = Path("looped.mcap")
    duration_s = None

    def __init__(self, count: int) -> None:
        self.frame_count = count
        self._states = motion(20)

    def arms(self) -> Iterator[ArmsState]:
        for k in range(self.frame_count):
            yield msgspec.structs.replace(self._states[k % 20], seq=k, sample_time_ns=10**9 + k * 11_111_111)

    def frames(self) -> Iterator[RecordedFrame]:
        yield from ()

    def calibrations(self, avatar: str) -> tuple[RecordedProfile, ...]:
        return ()


@pytest.mark.parametrize(
    ("suffix", "short", "long"),
    [
        ("bvh", 400, 1_200),
        pytest.param("bvh", 10_000, 40_000, marks=pytest.mark.slow),
        pytest.param("csv", 10_000, 40_000, marks=pytest.mark.slow),
        pytest.param("mcap", 10_000, 40_000, marks=pytest.mark.slow),
    ],
)
def test_memory_does_not_grow_with_the_session(tmp_path: Path, suffix: str, short: int, long: int) -> None:
    dialect = McapDialect.ROS2 if suffix == "mcap" else None
    export_session(Looped(300), tmp_path / f"warm.{suffix}", dialect=dialect)
    peaks, sizes = [], []
    for count in (short, long):
        output = tmp_path / f"{count}.{suffix}"
        tracemalloc.start()
        export_session(Looped(count), output, dialect=dialect)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        sizes.append(output.stat().st_size)
    assert peaks[1] - peaks[0] < 0.1 * (sizes[1] - sizes[0])


def long_session(path: Path, seconds: float, *, answers: bool) -> int:
    """Loop the bundled recording for so long; returns the number of frames."""
    once = list(
        solve_frames(open_session(bundled_session("reach_and_grab")).frames(), defaultdict(Profile), Settings())
    )
    period_ns = once[-1][0].frame.sample_time_ns - once[0][0].frame.sample_time_ns + 13_888_889
    count = 0
    with RecordingWriter(path) as writer:
        while count * period_ns < seconds * len(once) * 1e9:
            loop, k = divmod(count, len(once))
            recorded, state = once[k]
            times = {"seq": count, "sample_time_ns": recorded.frame.sample_time_ns + loop * period_ns}
            at_ns = (recorded.receive_time_ns or 0) + loop * period_ns
            writer.write_frame("ann", msgspec.structs.replace(recorded.frame, **times), at_ns)
            if answers:
                writer.write_arms("ann", msgspec.structs.replace(state, avatar="ann", **times), at_ns)
            count += 1
    return count


def peak_mb(*command: str) -> float:
    """The largest resident size of a process [MB], which has to end well."""
    with subprocess.Popen([*COMMAND, *command], stderr=subprocess.DEVNULL) as process:
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    return usage.ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "wait4"), reason="needs wait4 to ask for a process's memory")
@pytest.mark.parametrize("answers", [True, False], ids=["recorded", "to_be_solved"])
def test_a_session_ten_times_as_long_becomes_bvh_in_the_same_memory(tmp_path: Path, answers: bool) -> None:
    """Two minutes against twenty: an hour costs no more than what the index of a log of that length does."""
    peaks = []
    for seconds in (15.0, 120.0, 1200.0):  # the first, if anything, compiles
        session, output = tmp_path / f"{seconds:.0f}.mcap", tmp_path / f"{seconds:.0f}.bvh"
        frames = long_session(session, seconds, answers=answers)
        peaks.append(peak_mb("convert", str(session), str(output)))
        with output.open() as file:
            assert next(int(line.split()[1]) for line in file if line.startswith("Frames:")) >= 0.99 * frames
    assert peaks[2] - peaks[1] < 5.0, peaks
    assert output.stat().st_size > 30e6, "what is written is many times that"
