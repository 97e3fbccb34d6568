"""The Rerun view writes real recordings here, and they are read back with Rerun's own reader."""

from __future__ import annotations

import math
import os
import subprocess
import time
from collections import defaultdict
from pathlib import Path
from threading import Event
from typing import Any

import msgspec
import numpy as np
import pytest
from people import SKELETON, Answer, answer
from rerun.chunk import RrdReader

from arm_ik_service.errors import ViewError
from arm_ik_service.io.rerun_view import Connect, LiveView, RerunView, Save, Spawn, Web, write_recording
from arm_ik_service.io.rerun_view.palette import STATE_COLOURS
from arm_ik_service.io.rerun_view.sinks import free_port, viewer_binary
from arm_ik_service.wire.messages import ORIENTATION_VALID, SIDES, JointAngles, Skeleton, TrackingState


class Recorded:
    """Everything in an .rrd: entity -> component -> (frames, times [ns], values), static ones without times."""

    def __init__(self, path: Path) -> None:
        self.temporal: dict[tuple[str, str], list[tuple[int, int, Any]]] = defaultdict(list)
        self.static: dict[tuple[str, str], Any] = {}
        self.blueprints = len(RrdReader(path).blueprints())
        for chunk in RrdReader(path).stream():
            batch = chunk.to_record_batch()
            columns = {name: batch.column(k) for k, name in enumerate(batch.schema.names)}
            for k, field in enumerate(batch.schema):
                if ":" not in field.name:
                    continue
                key = (chunk.entity_path, field.name.rsplit("/", 1)[-1])
                values = batch.column(k).to_pylist()
                if chunk.is_static:
                    self.static[key] = values[0]
                    continue
                times = columns["sample_time"].cast("int64").to_pylist()
                for frame, time_ns, value in zip(columns["frame"].to_pylist(), times, values, strict=True):
                    if value is not None:
                        self.temporal[key].append((frame, time_ns, value))

    def of(self, entity: str, component: str) -> Any:
        """Values (N, ...) of a component in the order in which they were logged."""
        return np.array([value for _, _, value in self.temporal[entity, component]], float)

    def entities(self) -> set[str]:
        return {entity for entity, _ in (*self.temporal, *self.static)}


def recorded(tmp_path: Path, answers: list[Answer], skeleton: Skeleton | None = SKELETON) -> Recorded:
    path = tmp_path / "view.rrd"
    assert write_recording(path, answers, skeleton) == len(answers)
    return Recorded(path)


@pytest.fixture(scope="module")
def arms_and_recording(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Answer], Recorded]:
    answers = [answer(seq) for seq in range(20)]
    return answers, recorded(tmp_path_factory.mktemp("view"), answers)


def test_every_bone_stands_where_the_message_says(arms_and_recording: tuple[list[Answer], Recorded]) -> None:
    answers, log = arms_and_recording
    for side in SIDES:
        for bone in ("upper_arm", "forearm", "hand"):
            poses = [getattr(getattr(arms, side).bones, bone) for _, arms in answers]
            entity = f"/avatar/ann/{side}/{bone}"
            np.testing.assert_allclose(
                log.of(entity, "Transform3D:translation")[:, 0], [pose.position for pose in poses], atol=1e-6
            )
            np.testing.assert_allclose(
                log.of(entity, "Transform3D:quaternion")[:, 0], [pose.orientation for pose in poses], atol=1e-6
            )


def test_both_timelines_are_those_of_the_messages(arms_and_recording: tuple[list[Answer], Recorded]) -> None:
    answers, log = arms_and_recording
    for entity, component in (
        ("/avatar/ann/left/hand", "Transform3D:translation"),
        ("/avatar/ann/plots/latency_ms", "Scalars:scalars"),
    ):
        times = [(frame, time_ns) for frame, time_ns, _ in log.temporal[entity, component]]
        assert times == [(arms.seq, arms.sample_time_ns) for _, arms in answers]


def test_angles_and_their_velocities_are_plotted_in_degrees_between_bands_that_begin_at_their_limits(
    arms_and_recording: tuple[list[Answer], Recorded],
) -> None:
    answers, log = arms_and_recording
    for name in JointAngles.__struct_fields__:
        series = log.of(f"/avatar/ann/plots/angles/{name}", "Scalars:scalars")
        rates = log.of(f"/avatar/ann/plots/rates/{name}", "Scalars:scalars")
        for k, side in enumerate(SIDES):
            angles = np.array([getattr(getattr(arms, side).angles, name) for _, arms in answers])
            np.testing.assert_allclose(series[:, 2 + k], np.rad2deg(angles))
            np.testing.assert_allclose(rates[:, k], -np.rad2deg(angles))
        if name == "elbow_flexion":
            limits = np.rad2deg([0.0, 2.6])
            np.testing.assert_allclose(series[::2, :2], [limits] * (len(answers) // 2))
            beyond = limits + 0.08 * limits[1] * np.array([-1.0, 1.0])
            np.testing.assert_allclose(series[1::2, :2], [beyond] * (len(answers) // 2), err_msg="to and fro")
        else:
            assert np.isnan(series[:, :2]).all()


def test_residual_and_latency_are_in_the_units_of_their_names(
    arms_and_recording: tuple[list[Answer], Recorded],
) -> None:
    answers, log = arms_and_recording
    error = [[1e3 * arms.left.position_error_m, 1e3 * arms.right.position_error_m] for _, arms in answers]
    np.testing.assert_allclose(log.of("/avatar/ann/plots/residual_mm", "Scalars:scalars"), error)
    np.testing.assert_allclose(log.of("/avatar/ann/plots/latency_ms", "Scalars:scalars"), [[2.0, 0.25, 3.0]] * 20)


def test_a_session_solved_offline_has_no_latency_and_an_answer_without_its_frame_only_that_of_the_solve(
    tmp_path: Path,
) -> None:
    frame, arms = answer(0)
    path = tmp_path / "view.rrd"
    write_recording(path, [(frame, msgspec.structs.replace(arms, publish_time_ns=0)), (None, answer(1)[1])])
    latency = Recorded(path).of("/avatar/ann/plots/latency_ms", "Scalars:scalars")
    np.testing.assert_array_equal(latency, [[math.nan] * 3, [math.nan, 0.25, math.nan]])


def test_the_residual_line_runs_from_the_grip_in_the_hand_to_the_pose_asked_for(
    arms_and_recording: tuple[list[Answer], Recorded],
) -> None:
    answers, log = arms_and_recording
    for side, error in (("left", 0.0), ("right", 0.02)):
        line = log.of(f"/avatar/ann/{side}/residual", "LineStrips3D:strips")[:, 0]
        targets = [getattr(frame, side).position for frame, _ in answers]
        np.testing.assert_allclose(line[:, 1], targets, atol=1e-6)
        np.testing.assert_allclose(line[:, 1] - line[:, 0], [(0.0, error, 0.0)] * len(answers), atol=1e-6)


@pytest.mark.parametrize("flags", [0, ORIENTATION_VALID, None])
def test_a_target_that_is_not_valid_is_not_shown(tmp_path: Path, flags: int | None) -> None:
    frame, arms = answer(0)
    assert frame.left is not None
    left = None if flags is None else msgspec.structs.replace(frame.left, flags=flags, position=(math.nan,) * 3)
    log = recorded(tmp_path, [(msgspec.structs.replace(frame, left=left), arms)])
    hidden = log.of("/avatar/ann/left/target", "Transform3D:scale")
    shown = log.of("/avatar/ann/right/target", "Transform3D:scale")
    assert hidden.max() < 1e-3
    assert shown.min() == 1.0
    line = log.of("/avatar/ann/left/residual", "LineStrips3D:strips")[0, 0]
    np.testing.assert_array_equal(line[0], line[1])


def test_a_tracking_state_is_logged_where_it_changes_as_band_and_as_colour_of_the_hand(tmp_path: Path) -> None:
    states: list[TrackingState] = ["tracked", "tracked", "inferred", "held", "held", "lost", "tracked"]
    log = recorded(tmp_path, [answer(seq, right=state) for seq, state in enumerate(states)])
    band = [
        (frame, value[0]) for frame, _, value in log.temporal["/avatar/ann/plots/tracking/right", "StateChange:state"]
    ]
    assert band == [(0, "tracked"), (2, "inferred"), (3, "held"), (5, "lost"), (6, "tracked")]
    colours = [(frame, value[0]) for frame, _, value in log.temporal["/avatar/ann/right/hand", "Mesh3D:albedo_factor"]]
    for (frame, state), (at, colour) in zip(band, colours, strict=True):
        assert (frame, tuple(colour.to_bytes(4, "big")[:3])) == (at, STATE_COLOURS[state])
    assert len(log.temporal["/avatar/ann/plots/tracking/left", "StateChange:state"]) == 1


def test_rows_keep_their_order_and_none_is_missing_over_many_batches(tmp_path: Path) -> None:
    count = 1100
    log = recorded(tmp_path, [answer(seq) for seq in range(count)])
    frames = [frame for frame, _, _ in log.temporal["/avatar/ann/right/hand", "Transform3D:translation"]]
    assert frames == list(range(count))


def test_people_have_a_tree_each_and_meshes_are_logged_once(tmp_path: Path) -> None:
    path = tmp_path / "two.rrd"
    with RerunView(Save(path), spacing_m=1.5) as view:
        for seq in range(4):
            for name in ("ann", "bob.2"):
                frame, arms = answer(seq, avatar=name)
                view.add(arms, frame)
    log = Recorded(path)
    one, other = (
        {e.removeprefix(root) for e in log.entities() if e.startswith(root)}
        for root in ("/avatar/ann/", r"/avatar/bob.2/")
    )
    assert one == other
    assert "head/name" in one, "two people are told apart by their names"
    assert {"chest", "head", "neck", "left/forearm", "right/target", "plots/angles/pronation"} <= one
    assert len([key for key in log.temporal if key[1] == "Mesh3D:vertex_positions"]) == 0
    meshes = {entity for entity, component in log.static if component == "Mesh3D:vertex_positions"}
    assert len(meshes) == 2 * (3 + 2 * 5)
    np.testing.assert_allclose(log.static["/avatar/bob.2", "Transform3D:translation"], [[1.5, 0.0, 0.0]])
    assert log.blueprints >= 1


def test_a_person_nobody_described_is_measured(tmp_path: Path) -> None:
    described = recorded(tmp_path, [answer(0)])
    measured = recorded(tmp_path, [answer(0)], skeleton=None)
    for bone in ("upper_arm", "forearm"):
        key = (f"/avatar/ann/left/{bone}", "Mesh3D:vertex_positions")
        np.testing.assert_allclose(measured.static[key], described.static[key], atol=1e-6)


def test_bones_whose_length_is_learnt_reach_from_joint_to_joint_all_the_same(tmp_path: Path) -> None:
    longer = msgspec.structs.replace(SKELETON, upper_arm_m=0.25, forearm_m=0.325)
    log = recorded(tmp_path, [answer(0), answer(1)], longer)
    for bone, described, grown in (("upper_arm", 0.25, 0.30), ("forearm", 0.325, 0.26)):
        scale = log.of(f"/avatar/ann/left/{bone}", "Transform3D:scale")[:, 0]
        np.testing.assert_allclose(scale, [(1.0, grown / described, 1.0)] * 2, rtol=1e-5)


def eyes_of(path: Path) -> list[dict[str, Any]]:
    """The eyes of all blueprints, which the reader gives in no order: one for each person who came."""
    eyes = []
    for store in RrdReader(path).blueprints():
        eye: dict[str, Any] = {}
        for chunk in RrdReader(path).stream(store=store):
            batch = chunk.to_record_batch()
            for k, field in enumerate(batch.schema):
                if "EyeControls3D:" in field.name:
                    eye[field.name.rsplit(":", 1)[-1]] = batch.column(k).to_pylist()[0]
        eyes.append(eye)
    return eyes


@pytest.mark.slow
def test_the_eye_goes_along_with_one_person_and_stays_where_it_sees_all_of_many(tmp_path: Path) -> None:
    alone, group = tmp_path / "alone.rrd", tmp_path / "group.rrd"
    for path, names in ((alone, ["ann"]), (group, ["ann", "bob", "cleo", "dan", "eve", "fay", "gus"])):
        with RerunView(Save(path), spacing_m=1.2) as view:
            for name in names:
                frame, arms = answer(0, avatar=name)
                view.add(arms, frame)
    assert [eye["tracking_entity"] for eye in eyes_of(alone)] == [["avatar/ann/chest"]]
    eyes = eyes_of(group)
    assert sum(bool(eye.get("tracking_entity")) for eye in eyes) == 1, "until the second person came"
    last = max(eyes, key=lambda eye: sum(eye["look_target"][0]))  # the group grows towards +x and +z
    assert not last.get("tracking_entity")
    places = [
        Recorded(group).static.get((f"/avatar/{name}", "Transform3D:translation"), [[0.0, 0.0, 0.0]])[0]
        for name in ("ann", "bob", "cleo", "dan", "eve", "fay", "gus")
    ]
    apart = [np.linalg.norm(np.subtract(a, b)) for k, a in enumerate(places) for b in places[:k]]
    assert min(apart) > 1.19
    target = np.array(last["look_target"][0])
    np.testing.assert_allclose(target[[0, 2]], [0.5 * np.ptp(np.array(places)[:, k]) for k in (0, 2)], atol=1e-5)


def test_the_eye_stands_still_where_somebody_looks_on(tmp_path: Path) -> None:
    """Rerun 0.41 goes up close to whom it is told to follow where it has their data already: into the belly."""
    path = tmp_path / "live.rrd"
    with RerunView(Save(path)) as view:
        view.watched = True
        frame, arms = answer(0)
        view.add(arms, frame)
    (eye,) = eyes_of(path)
    assert not eye.get("tracking_entity")


def test_the_eye_stands_still_and_sees_all_of_a_stage(tmp_path: Path) -> None:
    path, places = tmp_path / "stage.rrd", [(0.0, 1.4, 0.0), (0.5, 0.8, -3.0), (1.0, 1.2, -1.6)]
    with RerunView(Save(path)) as view:
        view.stage(places)
        frame, arms = answer(0)
        view.add(arms, frame)
    (eye,) = eyes_of(path)
    assert not eye.get("tracking_entity")
    position, target = np.array(eye["position"][0]), np.array(eye["look_target"][0])
    gaze = (target - position) / np.linalg.norm(target - position)
    for place in places:
        away = (place - position) / np.linalg.norm(place - position)
        assert np.degrees(np.arccos(away @ gaze)) < 28.0
    assert position[0] > 1.0, "from the right of somebody who goes along -z"


def test_a_live_view_pairs_answers_with_frames_that_come_before_or_after(tmp_path: Path) -> None:
    path = tmp_path / "live.rrd"
    with LiveView(RerunView(Save(path)), period_s=3600.0) as live:
        for seq in range(4):
            frame, arms = answer(seq)
            if seq % 2:
                live.offer_frame("ann", frame)
            live.offer_arms(arms)
            if seq == 2:
                live.offer_frame("ann", frame)
    scale = Recorded(path).of("/avatar/ann/left/target", "Transform3D:scale")[:, 0, 0]
    assert list(scale > 0.5) == [False, True, True, True]
    assert (live.shown, live.unpaired, live.dropped) == (4, 1, 0)


def test_a_live_view_pairs_however_much_has_come_at_once(tmp_path: Path) -> None:
    with LiveView(RerunView(Save(tmp_path / "live.rrd")), period_s=3600.0) as live:
        for frame, arms in map(answer, range(900)):  # a second of ten people
            live.offer_frame("ann", frame)
            live.offer_arms(arms)
    assert (live.shown, live.unpaired, live.dropped) == (900, 0, 0)


def test_a_live_view_that_cannot_keep_up_drops_the_oldest_and_keeps_the_order(tmp_path: Path) -> None:
    path = tmp_path / "live.rrd"
    with LiveView(RerunView(Save(path)), period_s=3600.0, capacity=4) as live:
        for seq in range(10):
            live.offer_arms(answer(seq)[1])
    frames = [frame for frame, _, _ in Recorded(path).temporal["/avatar/ann/chest", "Transform3D:translation"]]
    assert frames == [6, 7, 8, 9]
    assert (live.shown, live.dropped) == (4, 6)


def test_a_killed_viewer_is_an_error_to_be_read_and_never_one_that_is_raised_while_offering(tmp_path: Path) -> None:
    port = free_port()
    with (tmp_path / "log").open("w") as log:
        viewer = subprocess.Popen(
            [str(viewer_binary()), "--serve-grpc", "--bind", "127.0.0.1", "--port", str(port)], stdout=log, stderr=log
        )
        give_up = time.monotonic() + 60.0
        live, gone = None, Event()
        while live is None:
            try:
                view = RerunView(Connect(f"rerun+http://127.0.0.1:{port}/proxy"))
                live = LiveView(view, when_gone=gone.set)
            except ViewError:
                assert time.monotonic() < give_up
                time.sleep(0.05)
        seq = 0
        with live:
            while not gone.is_set():
                assert time.monotonic() < give_up
                live.offer_arms(answer(seq)[1])
                seq += 1
                if live.shown and viewer.poll() is None:
                    viewer.kill()
                    viewer.wait()
                time.sleep(0.01)
    assert "gone" in str(live.error)


@pytest.mark.parametrize(
    ("sink", "says"),
    [
        (Save(Path("/nowhere/at/all.rrd")), "/nowhere/at/all.rrd: No such file or directory"),
        (Save(Path("/")), "cannot write /: Is a directory"),
        (Connect("127.0.0.1:9876"), "no address of a viewer"),
        (Connect(f"rerun+http://127.0.0.1:{free_port()}/proxy"), "no Rerun viewer answers"),
    ],
    ids=["missing folder", "directory", "not an address", "nobody there"],
)
def test_a_sink_that_cannot_be_opened_says_why_in_one_line(sink: Save | Connect, says: str) -> None:
    with pytest.raises(ViewError) as caught:
        RerunView(sink)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_without_a_display_the_desktop_viewer_is_refused_with_what_to_do_instead(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    if os.name != "posix" or os.uname().sysname != "Linux":
        pytest.skip("only Linux has no display")
    with pytest.raises(ViewError, match="--save"):
        RerunView(Spawn())


def test_a_web_port_in_use_is_named() -> None:
    web = Web(port=free_port(), data_port=free_port())
    with RerunView(web), pytest.raises(ViewError, match=str(web.data_port)):
        RerunView(web)


def test_a_full_disk_is_a_view_error() -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("needs /dev/full")
    with pytest.raises(ViewError, match="No space left"):
        write_recording(full, (answer(seq) for seq in range(3)))
