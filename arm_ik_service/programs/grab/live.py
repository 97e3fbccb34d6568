"""The scene where it can be seen and meddled with: in Rerun, in a recording, on the bus."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from threading import Event, Lock
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from arm_ik_service.errors import DecodeError, SettingsError
from arm_ik_service.io.recording import RecordingWriter
from arm_ik_service.io.rerun_view import Overlay, RerunView, Sink, Skin
from arm_ik_service.io.zenoh_streams import Bus, answer_queries, declare_stream, put_once, subscribe
from arm_ik_service.programs.elbow_comfort import ElbowComforts
from arm_ik_service.programs.grab.scene import CUBE_M, RATE_HZ, Moment, Scene
from arm_ik_service.skeleton import skeleton_of
from arm_ik_service.wire import codec
from arm_ik_service.wire.codec import MapDecoder
from arm_ik_service.wire.keys import Keys
from arm_ik_service.wire.messages import Pose, Quaternion, Vector

Floats = npt.NDArray[np.float64]

CUBE_KEY = "scene/cube/pose"
VIEW_EVERY = 3  # frames, 30 a second
FARTHEST_M = 100.0  # a cube beyond that is a mistake


class CubePose(msgspec.Struct, frozen=True):
    """What is put on `scene/cube/pose`, as JSON or MessagePack: the centre [m] and, if it matters, the axes."""

    position: Vector
    orientation: Quaternion = (0.0, 0.0, 0.0, 1.0)


_cube_poses = MapDecoder(CubePose)


def cube_pose(payload: bytes) -> Floats:
    """Return the pose (7,) that a payload holds. Raises SettingsError naming what is wrong with it."""
    try:
        told = _cube_poses.decode(payload)
    except DecodeError as error:
        raise SettingsError(f"{CUBE_KEY}: {error}") from error
    pose = np.array([*told.position, *told.orientation])
    length = float(np.linalg.norm(pose[3:]))
    if not np.isfinite(pose).all() or length < 1e-3 or np.abs(pose[:3]).max() > FARTHEST_M:
        raise SettingsError(f"{CUBE_KEY}: {told} is no place for a cube")
    pose[3:] /= length
    return pose


def _pose(pose: Floats) -> Pose:
    x, y, z, qx, qy, qz, qw = pose.tolist()
    return Pose((x, y, z), (qx, qy, qz, qw))


def _vector(place: Floats) -> Vector:
    x, y, z = place.tolist()
    return (x, y, z)


class GrabShow:
    """Runs a scene into sinks, a recording and an open Zenoh session, any of which may be missing."""

    def __init__(
        self,
        scene: Scene,
        *,
        bus: Bus | None = None,
        keys: Keys | None = None,
        sinks: list[Sink] | None = None,
        skin: Skin | None = None,
        overlays: frozenset[Overlay] = frozenset(),
        record: Path | None = None,
        say: Callable[[str], None] = lambda text: None,
    ) -> None:
        """Open what is asked for. Raises ViewError or SessionError."""
        self._scene, self._say = scene, say
        self._avatar = scene.figure.avatar
        self._stopped = Event()
        self._lock = Lock()
        self._moved: Floats | None = None  # where somebody put the cube, until the next frame
        self._cube = scene.cube.copy()
        self.refused = 0
        self._skeleton = skeleton_of(self._avatar, scene.figure.profile)
        comfort = ElbowComforts() if "swivel" in overlays else None
        self._view = RerunView(*sinks, name="arm-ik grab", skin=skin, show=overlays, comfort=comfort) if sinks else None
        self._box = self._view.box("cube", CUBE_M) if self._view else None
        if self._view is not None:
            self._view.describe(self._skeleton)
        self._legs = self._view.legs(self._avatar) if self._view else None
        self._writer = RecordingWriter(record, {"about": "arm-ik grab"}) if record else None
        keys = keys or Keys()
        self._cube_key = f"{keys.prefix}/{CUBE_KEY}" if keys.prefix else CUBE_KEY
        self._open_bus(bus, keys)

    def stop(self) -> None:
        """Make `run` return; safe in a signal handler."""
        self._stopped.set()

    def run(self, duration_s: float, *, real_time: bool) -> Moment | None:
        """Play until the scene is over, `stop`, or for `duration_s`; returns the last moment."""
        begun, last = time.monotonic(), None
        stage = ""
        for count, moment in enumerate(self._scene.moments(duration_s)):
            last = moment
            if moment.stage != stage:
                stage = moment.stage
                self._say(f"{count / RATE_HZ:6.2f} s  {stage}")
            self._show(count, moment)
            if real_time:
                wait = begun + (count + 1) / RATE_HZ - time.monotonic()
                self._stopped.wait(max(wait, 0.0))
            if self._stopped.is_set():
                break
            with self._lock:
                moved, self._moved = self._moved, None
                self._cube = moment.cube
            if moved is not None:
                self._say(f"{count / RATE_HZ:6.2f} s  somebody put the cube at {np.round(moved[:3], 3).tolist()}")
                self._scene.move_cube(moved)
        return last

    def close(self) -> None:
        """Finish the view and the recording. Raises ViewError or SessionError."""
        for thing in self._declared:
            thing.undeclare()
        if self._writer is not None:
            self._writer.close()
        if self._view is not None:
            self._view.close()

    def _open_bus(self, bus: Bus | None, keys: Keys) -> None:
        self._declared: list[Any] = []  # subscriber, queryables, publishers
        self._streams = None
        if bus is None:
            return
        self._streams = (
            declare_stream(bus, keys.controllers(self._avatar), "msgpack"),
            declare_stream(bus, keys.arms(self._avatar), "msgpack"),
            declare_stream(bus, keys.watched_controllers(self._avatar), "msgpack"),
            declare_stream(bus, keys.watched_arms(self._avatar), "msgpack"),
        )
        skeleton = codec.encode(self._skeleton)
        key = keys.skeleton(self._avatar)
        put_once(bus, key, skeleton, "msgpack")
        self._declared = [
            subscribe(bus, self._cube_key, self._take_cube),
            answer_queries(bus, self._cube_key, lambda: [(self._cube_key, self._told_cube)], "json"),
            answer_queries(bus, key, lambda: [(key, lambda: skeleton)], "msgpack"),
            *self._streams,
        ]

    def _take_cube(self, _key: str, payload: bytes, _time_ns: int) -> None:
        try:
            pose = cube_pose(payload)
        except SettingsError as error:
            self.refused += 1
            self._say(str(error))
            return
        with self._lock:
            self._moved = pose

    def _told_cube(self) -> bytes:
        with self._lock:
            return msgspec.json.encode(_pose(self._cube))

    def _show(self, count: int, moment: Moment) -> None:
        if self._streams is not None:
            payloads = codec.encode(moment.frame), codec.encode(moment.arms)
            for stream, payload in zip(self._streams, 2 * payloads, strict=True):
                stream.put(payload)
        if self._writer is not None:
            if count == 0:
                self._writer.write_skeleton(self._avatar, codec.encode(self._skeleton), moment.arms.receive_time_ns)
            self._writer.write_frame(self._avatar, moment.frame, moment.arms.receive_time_ns)
            self._writer.write_arms(self._avatar, moment.arms, moment.arms.receive_time_ns)
            self._writer.write_pose(self._cube_key, _pose(moment.cube), moment.arms.receive_time_ns)
        if self._view is not None and self._box is not None:
            if count == 0:
                places = [moment.cube[:3]] if self._scene.goal is None else [moment.cube[:3], self._scene.goal]
                self._view.stage([moment.arms.chest.position, *(_vector(place) for place in places)])
            self._view.add(moment.arms, moment.frame)
            self._box.add(moment.arms.seq, moment.arms.sample_time_ns, moment.cube)
            if self._legs is not None:
                self._legs.add(moment.arms.seq, moment.arms.sample_time_ns, moment.legs)
            if self._view.watched and count % VIEW_EVERY == 0:
                self._view.flush()
