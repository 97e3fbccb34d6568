"""MCAP files in other people's dialects: `ros2`, `foxglove` and `openxr`. Ours is io/recording's.

Messages are logged at the sample time, which is also in their stamps, so that players and frame trees agree.
"""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from mcap.writer import CompressionType, Writer

from arm_ik_service import __version__
from arm_ik_service.errors import SessionError
from arm_ik_service.exports.dialects import McapDialect
from arm_ik_service.exports.frames import frames_of
from arm_ik_service.wire.messages import ArmsState

CHUNK_SIZE = 1 << 20


class StateWriter(Protocol):
    """A file being written from states."""

    def add(self, state: ArmsState) -> None:
        """Add one state."""

    def close(self) -> None:
        """End the file."""


class _McapFile:
    """Schemas and channels by name, made when first used."""

    def __init__(self, path: Path, profile: str) -> None:
        self.path = path
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._count = 0
        try:
            self._file = path.open("wb")
        except OSError as error:
            raise SessionError(f"{path}: cannot be written: {error.strerror}") from error
        self._writer = Writer(self._file, chunk_size=CHUNK_SIZE, compression=CompressionType.ZSTD)
        self._writer.start(profile, f"arm-ik-service {__version__}")

    def schema(self, name: str, encoding: str, data: bytes) -> None:
        """Register a schema."""
        self._schemas[name] = self._writer.register_schema(name, encoding, data)

    def add(self, topic: str, schema: str, encoding: str, time_ns: int, data: bytes) -> None:
        """Add a message to a topic."""
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._channels[topic] = self._writer.register_channel(topic, encoding, self._schemas[schema])
        time_ns = max(0, time_ns)  # MCAP times are unsigned
        try:
            self._writer.add_message(channel, time_ns, data, time_ns, self._count & 0xFFFFFFFF)
        except OSError as error:
            raise SessionError(f"{self.path}: cannot be written: {error.strerror}") from error
        self._count += 1

    def close(self) -> None:
        """Write the index and close the file."""
        with self._file:
            self._writer.finish()


class Ros2Writer:
    """JointState and TFMessage in CDR, profile `ros2`: what `ros2 bag` and Foxglove read."""

    def __init__(self, path: Path) -> None:
        from arm_ik_service.exports import ros2

        self._ros2 = ros2
        self._file = _McapFile(path, "ros2")
        for kind in (ros2.JOINT_STATE, ros2.TF_MESSAGE):
            self._file.schema(kind, "ros2msg", ros2.definition(kind).encode())

    def add(self, state: ArmsState) -> None:
        """Add one state."""
        ros2, time_ns = self._ros2, state.sample_time_ns
        joints = ros2.joint_state(state, time_ns)
        self._file.add(ros2.joint_topic(state.avatar), ros2.JOINT_STATE, "cdr", time_ns, joints)
        self._file.add(ros2.TF_TOPIC, ros2.TF_MESSAGE, "cdr", time_ns, ros2.transforms(state, time_ns))

    def close(self) -> None:
        """End the file."""
        self._file.close()


class FoxgloveWriter:
    """Foxglove's schemas in protobuf: opens in Foxglove with a moving arm."""

    def __init__(self, path: Path) -> None:
        from foxglove.messages import FrameTransforms, JointStates, SceneUpdate

        from arm_ik_service.exports import foxglove_messages

        self._messages = foxglove_messages
        self._scenes: dict[str, foxglove_messages.Scene] = {}
        self._file = _McapFile(path, "")
        for kind in (FrameTransforms, JointStates, SceneUpdate):
            schema = kind.get_schema()
            self._file.schema(schema.name, schema.encoding, schema.data)

    def add(self, state: ArmsState) -> None:
        """Add one state."""
        messages, time_ns = self._messages, state.sample_time_ns
        frames = list(frames_of(state))
        prefix = f"/{frames[0].child.partition('/')[0]}"
        self._protobuf("/tf", "FrameTransforms", time_ns, messages.frame_transforms(frames, time_ns))
        self._protobuf(f"{prefix}/joint_states", "JointStates", time_ns, messages.joint_states(state, time_ns))
        scene = self._scenes.setdefault(state.avatar, messages.Scene()).update(state, frames, time_ns)
        if scene is not None:
            self._protobuf(f"{prefix}/body", "SceneUpdate", time_ns, scene)

    def close(self) -> None:
        """End the file."""
        self._file.close()

    def _protobuf(self, topic: str, kind: str, time_ns: int, data: bytes) -> None:
        self._file.add(topic, f"foxglove.{kind}", "protobuf", time_ns, data)


class BodyTrackingWriter:
    """XR_FB_body_tracking's joints as JSON."""

    def __init__(self, path: Path) -> None:
        from arm_ik_service.exports import body_tracking

        self._body_tracking = body_tracking
        self._file = _McapFile(path, "")
        self._file.schema(body_tracking.SCHEMA_NAME, "jsonschema", body_tracking.json_schema())

    def add(self, state: ArmsState) -> None:
        """Add one state."""
        body_tracking = self._body_tracking
        joints = body_tracking.encode(body_tracking.body_joints(state))
        topic = body_tracking.key(state.avatar)
        self._file.add(topic, body_tracking.SCHEMA_NAME, "json", state.sample_time_ns, joints)

    def close(self) -> None:
        """End the file."""
        self._file.close()


WRITERS: dict[McapDialect, type[Ros2Writer] | type[FoxgloveWriter] | type[BodyTrackingWriter]] = {
    McapDialect.ROS2: Ros2Writer,
    McapDialect.FOXGLOVE: FoxgloveWriter,
    McapDialect.OPENXR: BodyTrackingWriter,
}
