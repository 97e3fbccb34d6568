"""Recording, replaying and solving again: what went through the bus comes out of the file, whoever is killed."""

from __future__ import annotations

import itertools
import json
import math
import os
import signal
import subprocess
import time
from pathlib import Path

import msgspec
import numpy as np
import pytest
from harness import COMMAND, KEYS, Running, Service, may_idle, wait_for

from arm_ik_service.body.profile import BodyMeasures, Profile
from arm_ik_service.io.recording import RecordingWriter, open_recording
from arm_ik_service.io.session import open_session
from arm_ik_service.io.zenoh_bus import BusOptions, open_client
from arm_ik_service.io.zenoh_streams import put_once, subscribe
from arm_ik_service.programs.demo import bundled_session, free_endpoint
from arm_ik_service.programs.offline import profiles_for
from arm_ik_service.programs.replayer import ReplayOptions, selected

FAST = ["--speed", "6"]  # what the tests need is the frames, not the minutes


def arm_ik(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, timeout=120)


@pytest.fixture(scope="module")
def recording() -> Path:
    return bundled_session("reach_and_grab")


def shortened(recording: Path, path: Path, seconds: float) -> Path:
    """Write the first seconds of a recording as one of its own."""
    with RecordingWriter(path) as writer:
        for recorded in open_session(recording).frames():
            if writer.message_count >= 72 * seconds:
                break
            writer.write_frame(recorded.avatar, recorded.frame, recorded.receive_time_ns or 0)
    return path


def test_a_replay_is_answered_frame_by_frame_recorded_as_it_was_and_solved_again_to_the_same_bytes(
    service: Service, recording: Path, tmp_path: Path
) -> None:
    copy = tmp_path / "copy.mcap"
    recorder = Running("record", str(copy), "--connect", service.endpoint)
    recorder.wait_ready()
    played = arm_ik("replay", str(recording), "--json", *FAST, "--connect", service.endpoint)
    assert played.returncode == 0, played.stderr
    frames = json.loads(played.stdout)["frames"]
    assert wait_for(lambda: service.answered_and_overtaken("demo") == frames, 5.0), service.healths[-1]
    answers = service.take(service.healths[-1].answered)
    assert recorder.end(signal.SIGINT) == 0
    assert len({answer.seq for answer in answers}) == len(answers) == service.healths[-1].answered

    original = {recorded.frame.seq: recorded.frame for recorded in open_session(recording).frames()}
    for recorded in open_session(copy).frames():
        frame, before = recorded.frame, original[recorded.frame.seq]
        assert msgspec.structs.replace(frame, publish_time_ns=before.publish_time_ns) == before

    solved = arm_ik("solve", str(copy), "--verify", "--json")
    assert solved.returncode == 0, solved.stdout + solved.stderr
    report = json.loads(solved.stdout)
    assert (report["compared"], report["different"], report["unanswered"]) == (len(answers), 0, 0)


@pytest.mark.parametrize("jitter_buffer_s", [0.0, pytest.param(0.05, marks=pytest.mark.slow)])
def test_a_person_measured_while_they_are_recorded_is_solved_again_to_the_same_bytes(
    jitter_buffer_s: float, recording: Path, tmp_path: Path
) -> None:
    copy, endpoint = tmp_path / "copy.mcap", free_endpoint()
    settings = tmp_path / "settings.toml"
    settings.write_text(f"[service]\njitter_buffer_s = {jitter_buffer_s}\n")
    connect, settled = ["--connect", endpoint], ["--settings", str(settings)]
    service = Running("serve", "--listen", endpoint, *settled)
    service.wait_ready()
    recorder = Running("record", str(copy), *connect)
    recorder.wait_ready()
    with open_client(BusOptions(connect=(endpoint,)), wait_s=10.0) as bus:
        answered: list[bytes] = []
        subscribe(bus, KEYS.arms("demo"), lambda _key, payload, _ns: answered.append(payload))
        player = Running("replay", str(recording), "--to", "6", *connect)
        for most, stature in ((100, 1.6), (250, 1.9)):
            deadline_s = time.monotonic() + 30.0
            while len(answered) < most:
                assert time.monotonic() < deadline_s
                time.sleep(0.01)
            body = {"stature_m": stature, "upper_arm_m": 0.3, "forearm_m": 0.25}
            put_once(bus, KEYS.calibration("demo"), msgspec.json.encode({"body": body}), "json")
        assert player.finish() == 0
        time.sleep(0.2)
    assert recorder.end(signal.SIGINT) == 0
    assert service.end() == 0
    solved = arm_ik("solve", str(copy), "--verify", "--json", *settled)
    assert solved.returncode == 0, solved.stdout + solved.stderr
    report = json.loads(solved.stdout)
    assert (report["different"], report["unanswered"], report["measured_anew"]) == (0, 0, 2)
    assert report["compared"] > 300


def test_killing_every_other_program_leaves_the_service_answering_and_a_log_that_plays(
    service: Service, recording: Path, tmp_path: Path
) -> None:
    log = tmp_path / "killed.mcap"
    connect = ["--connect", service.endpoint]
    doomed = [
        Running("replay", str(recording), "--loop", "--avatar", "other", *connect),
        Running("record", str(log), *connect),
        Running("view", "--save", str(tmp_path / "killed.rrd"), *connect),
    ]
    for process in doomed[1:]:
        process.wait_ready()
    if may_idle():  # nobody waits for a file, but a recording must not lose anything
        assert [os.sched_getscheduler(process.popen.pid) for process in doomed[1:]] == [os.SCHED_OTHER, os.SCHED_IDLE]
    player = Running("replay", str(recording), "--to", "4", *connect)
    assert wait_for(lambda: service.answered_and_overtaken("demo") > 0, 20.0)
    for process in doomed:
        process.popen.kill()
        process.popen.wait()
        time.sleep(0.2)
    assert player.finish() == 0
    sent = sum(1 for _ in selected(open_session(recording).frames(), ReplayOptions(to_s=4.0)))
    assert wait_for(lambda: service.answered_and_overtaken("demo") == sent, 5.0), service.healths[-1]
    assert service.process.popen.poll() is None

    played = arm_ik("replay", str(log), "--speed", "20", "--avatar", "again", "--json", *connect)
    assert played.returncode == 0, played.stderr
    assert json.loads(played.stdout)["frames"] > 60


@pytest.mark.slow
def test_a_view_records_beside_what_it_shows(service: Service, recording: Path, tmp_path: Path) -> None:
    log, seen = tmp_path / "beside.mcap", tmp_path / "seen.rrd"
    beside = ["--save", str(seen), "--record", str(log), "--connect", service.endpoint]
    view = Running("view", *beside)
    view.wait_ready()
    assert arm_ik("replay", str(recording), "--to", "2", "--connect", service.endpoint).returncode == 0
    answers = service.take(10_000, 0.5)
    assert view.end() == 0
    session = open_recording(log)
    assert [state.seq for state in session.arms()] == [state.seq for state in answers]
    assert session.frame_count == len({recorded.frame.seq for recorded in session.frames()}) >= len(answers)
    assert session.skeleton("demo") is not None
    assert view.says(f"{len(answers)} answers drawn")
    assert seen.stat().st_size > 100_000
    again = Running("view", *beside)
    assert again.finish() == 2
    assert "exists" in again.lines[-1]


def test_a_replay_started_before_the_service_waits_and_then_plays(recording: Path) -> None:
    endpoint = free_endpoint()
    player = Running("replay", str(recording), "--to", "1", "--connect", endpoint)
    assert player.says("waiting for")
    service = Running("serve", "--listen", endpoint)
    service.wait_ready()
    assert player.finish() == 0
    assert service.end() == 0
    assert not any("answered 0 frames" in line for line in service.lines)


@pytest.mark.parametrize("name", ["reach_and_grab", "boxing", "tracking_loss"])
def test_every_bundled_recording_solves_to_finite_numbers_with_the_hands_on_their_targets(
    name: str, tmp_path: Path
) -> None:
    out = tmp_path / "arms.npz"
    solved = arm_ik("solve", str(bundled_session(name)), "-o", str(out))
    assert solved.returncode == 0, solved.stderr
    arrays = np.load(out)
    for key in arrays.files:
        if arrays[key].dtype.kind == "f":
            assert np.isfinite(arrays[key]).all(), key
    for side in ("left", "right"):
        tracked = arrays[f"{side}_tracking"] == "tracked"
        assert tracked.any()
        assert np.median(arrays[f"{side}_position_error_m"][tracked]) < 1e-3


def test_solving_twice_gives_the_same_bytes(tmp_path: Path, recording: Path) -> None:
    outputs = [tmp_path / "one.npz", tmp_path / "two.npz"]
    for output in outputs:
        assert arm_ik("solve", str(recording), "-o", str(output)).returncode == 0
    one, two = (np.load(output) for output in outputs)
    assert all(one[key].tobytes() == two[key].tobytes() for key in one.files)


def test_the_demo_ends_with_its_summary(tmp_path: Path, recording: Path) -> None:
    short = shortened(recording, tmp_path / "short.mcap", 2.0)
    picture = tmp_path / "demo.rrd"
    result = arm_ik("demo", str(short), "--save", str(picture))
    assert result.returncode == 0, result.stderr
    for word in ("frames answered", "rate", "latency", "residual", "iterations", "joint limits"):
        assert word in result.stdout
    assert picture.stat().st_size > 100_000


def test_everybody_in_a_recording_is_solved_with_their_own_measures(recording: Path, tmp_path: Path) -> None:
    statures = {"ann": 1.5, "bob": 1.9}
    together, solved = tmp_path / "together.mcap", tmp_path / "solved.mcap"
    with RecordingWriter(together) as writer:
        for name, stature in statures.items():
            profile = Profile(body=BodyMeasures(stature_m=stature))
            writer.write_calibration(name, msgspec.json.encode(profile), 0)
        for recorded in itertools.islice(open_session(recording).frames(), 20):
            for name in (*statures, "eve"):
                writer.write_frame(name, recorded.frame, recorded.receive_time_ns or 0)
    assert arm_ik("solve", str(together), "-o", str(solved)).returncode == 0
    session = open_session(solved)
    used = {name: profile.body.stature_m for name, profile in profiles_for(session).items()}
    assert used == statures | {"eve": Profile().body.stature_m}
    forearms = {
        state.avatar: math.dist(state.left.bones.forearm.position, state.left.bones.hand.position)
        for state in session.arms()
    }
    assert forearms["ann"] < forearms["eve"] < forearms["bob"]


@pytest.mark.parametrize("name", ["arms.npz", "arms.mcap"])
def test_somebody_who_is_not_in_a_recording_is_refused_in_one_line(recording: Path, tmp_path: Path, name: str) -> None:
    refused = arm_ik("solve", str(recording), "--avatar", "nobody", "-o", str(tmp_path / name))
    assert refused.returncode == 2
    assert "no avatar 'nobody'; it has demo" in refused.stderr
    assert not list(tmp_path.iterdir())
