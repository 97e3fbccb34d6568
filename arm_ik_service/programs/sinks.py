"""Where live states can go: one class a dialect, each taking a state and what it answers."""

from __future__ import annotations

import time
from typing import Any, Protocol

from arm_ik_service.exports import body_tracking, vmc, vrchat
from arm_ik_service.exports.extras import optional_libraries
from arm_ik_service.exports.osc import OscTarget
from arm_ik_service.io.zenoh_streams import Bus, Stream, announce, declare_stream
from arm_ik_service.wire.messages import ArmsState, ControllerFrame


class Sink(Protocol):
    """Takes the newest states of one avatar or of all."""

    many: bool  # whether it can tell several people apart
    wants_frames: bool  # whether `frame` is of use to it

    def send(self, state: ArmsState, frame: ControllerFrame | None) -> None:
        """Send one state; `frame` is the one it answers, if wanted and heard. Never raises, never waits."""

    def close(self) -> None:
        """Let go of what it holds."""


class VmcSink:
    """VMC over OSC."""

    many = False
    wants_frames = True

    def __init__(self, host: str, port: int, lower_arm_twist: float = vmc.LOWER_ARM_TWIST) -> None:
        self._vmc = vmc.Vmc(lower_arm_twist)
        self._target = OscTarget(host, port)

    def send(self, state: ArmsState, frame: ControllerFrame | None) -> None:
        """Send two packets: trunk and devices, then the arms."""
        for messages in self._vmc.packets(state, frame):
            self._target.send(messages)

    def close(self) -> None:
        """Let go of the socket."""
        self._target.close()


class VrChatSink:
    """VRChat's OSC trackers."""

    many = False
    wants_frames = False

    def __init__(self, host: str, port: int, *, chest: bool = False) -> None:
        self._chest = chest
        self._target = OscTarget(host, port)

    def send(self, state: ArmsState, frame: ControllerFrame | None) -> None:
        """Send one packet."""
        self._target.send(vrchat.messages(state, chest=self._chest))

    def close(self) -> None:
        """Let go of the socket."""
        self._target.close()


class Ros2Sink:
    """CDR on Zenoh, under the keys of rmw_zenoh, of zenoh-bridge-ros2dds, or both.

    Stamps are the wall clock when the service received the frame: ROS nodes compare them with their own.
    """

    many = True
    wants_frames = False

    def __init__(self, bus: Bus, *, domain: int = 0, rmw_zenoh: bool = True, bridge: bool = True) -> None:
        with optional_libraries():
            from arm_ik_service.exports import ros2
        from arm_ik_service.io.zenoh_ros import declare_cdr, session_id

        self._bus, self._ros2, self._declare = bus, ros2, declare_cdr
        self._rmw_zenoh, self._bridge = rmw_zenoh, bridge
        self._node = ros2.RmwNode(session_id(bus), domain)
        self._tokens: list[Any] = [announce(bus, self._node.node_token())] if rmw_zenoh else []
        self._publishers: dict[str, list[tuple[Stream, str | None]]] = {}
        self._sequences: dict[str, int] = {}

    def send(self, state: ArmsState, frame: ControllerFrame | None) -> None:
        """Put a JointState and a TFMessage."""
        ros2, stamp_ns = self._ros2, state.receive_time_ns or state.sample_time_ns
        self._put(ros2.joint_topic(state.avatar), ros2.JOINT_STATE, ros2.joint_state(state, stamp_ns))
        self._put(ros2.TF_TOPIC, ros2.TF_MESSAGE, ros2.transforms(state, stamp_ns))

    def close(self) -> None:
        """Leave the graph."""
        for token in self._tokens:
            token.undeclare()
        for publishers in self._publishers.values():
            for publisher, _ in publishers:
                publisher.undeclare()

    def _put(self, topic: str, kind: str, payload: bytes) -> None:
        publishers = self._publishers.get(topic)
        if publishers is None:
            publishers = self._publishers[topic] = self._declared(topic, kind)
        sequence = self._sequences[topic] = self._sequences.get(topic, 0) + 1
        for publisher, token in publishers:
            beside = None if token is None else self._ros2.attachment(sequence, time.time_ns(), token)
            publisher.put(payload, attachment=beside)

    def _declared(self, topic: str, kind: str) -> list[tuple[Stream, str | None]]:
        publishers: list[tuple[Stream, str | None]] = []
        if self._rmw_zenoh:
            token = self._node.publisher_token(len(self._publishers) + 1, topic, kind)
            self._tokens.append(announce(self._bus, token))
            key = self._ros2.rmw_zenoh_key(topic, kind, self._node.domain)
            publishers.append((self._declare(self._bus, key), token))
        if self._bridge:
            publishers.append((self._declare(self._bus, self._ros2.bridge_key(topic)), None))
        return publishers


class BodyTrackingSink:
    """XR_FB_body_tracking's joints as JSON on Zenoh."""

    many = True
    wants_frames = False

    def __init__(self, bus: Bus, prefix: str = "") -> None:
        self._bus, self._prefix = bus, prefix
        self._streams: dict[str, Stream] = {}

    def send(self, state: ArmsState, frame: ControllerFrame | None) -> None:
        """Put the joints of one state."""
        stream = self._streams.get(state.avatar)
        if stream is None:
            key = body_tracking.key(state.avatar, self._prefix)
            stream = self._streams[state.avatar] = declare_stream(self._bus, key, "json")
        stream.put(body_tracking.encode(body_tracking.body_joints(state)))

    def close(self) -> None:
        """Stop publishing."""
        for stream in self._streams.values():
            stream.undeclare()
