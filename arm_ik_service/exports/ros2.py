"""ROS 2: joints as sensor_msgs/JointState and bones as tf2_msgs/TFMessage, in CDR, under the names each world expects.

Topics: `/avatar_<id>/joint_states`, its joints named `left_` or `right_` and the nine angles of JointAngles, and `/tf`,
the frames of `frames.py`.

Two ways to ROS over Zenoh: rmw_zenoh keys carry domain, type and type hash, and every message an attachment (see its
design.md and attachment_helpers.cpp); behind zenoh-bridge-ros2dds a key is the plain topic.
"""

from __future__ import annotations

import hashlib
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from arm_ik_service.exports.frames import frames_of, ros_name
from arm_ik_service.exports.joints import JOINT_NAMES, positions_of, velocities_of
from arm_ik_service.wire.messages import ArmsState

JOINT_STATE, TF_MESSAGE = "sensor_msgs/msg/JointState", "tf2_msgs/msg/TFMessage"
TF_TOPIC = "/tf"
NANOSECONDS = 1_000_000_000

_types = get_typestore(Stores.ROS2_JAZZY)  # both definitions are the same in every release of ROS 2
_Time, _Header = _types.types["builtin_interfaces/msg/Time"], _types.types["std_msgs/msg/Header"]
_JointState, _TFMessage = _types.types[JOINT_STATE], _types.types[TF_MESSAGE]
_TransformStamped = _types.types["geometry_msgs/msg/TransformStamped"]
_Transform = _types.types["geometry_msgs/msg/Transform"]
_Vector3, _Quaternion = _types.types["geometry_msgs/msg/Vector3"], _types.types["geometry_msgs/msg/Quaternion"]


def joint_topic(avatar: str) -> str:
    """Topic of an avatar's JointState."""
    return f"/{ros_name(avatar)}/joint_states"


def definition(kind: str) -> str:
    """Return the message definition with all that it refers to, as `ros2msg` schemas have it."""
    return _types.generate_msgdef(kind, ros_version=2)[0]


def joint_state(state: ArmsState, stamp_ns: int) -> bytes:
    """Encode the angles [rad] and their rates [rad/s] of both arms in CDR."""
    message = _JointState(
        header=_header(stamp_ns, ""),
        name=list(JOINT_NAMES),
        position=np.array(positions_of(state)),
        velocity=np.array(velocities_of(state)),
        effort=np.zeros(0),
    )
    return bytes(_types.serialize_cdr(message, JOINT_STATE))


def transforms(state: ArmsState, stamp_ns: int) -> bytes:
    """Encode the frame tree of one state in CDR."""
    message = _TFMessage(
        transforms=[
            _TransformStamped(
                header=_header(stamp_ns, frame.parent),
                child_frame_id=frame.child,
                transform=_Transform(translation=_Vector3(*frame.position), rotation=_Quaternion(*frame.rotation)),
            )
            for frame in frames_of(state)
        ]
    )
    return bytes(_types.serialize_cdr(message, TF_MESSAGE))


def bridge_key(topic: str) -> str:
    """Return the Zenoh key of a topic behind zenoh-bridge-ros2dds."""
    return topic.strip("/")


def rmw_zenoh_key(topic: str, kind: str, domain: int) -> str:
    """Return the Zenoh key of a topic among ROS 2 nodes that run on rmw_zenoh."""
    return f"{domain}/{topic.strip('/')}/{_dds_type(kind)}/{_types.hash_rihs01(kind)}"


@dataclass(frozen=True)
class RmwNode:
    """Our node as rmw_zenoh's graph sees it: the keys of the liveliness tokens that `ros2 topic list` reads."""

    session_id: str
    domain: int = 0
    name: str = "arm_ik"

    def node_token(self) -> str:
        """Return the key of the node's token."""
        return f"@ros2_lv/{self.domain}/{self.session_id}/0/0/NN/%/%/{self.name}"

    def publisher_token(self, number: int, topic: str, kind: str) -> str:
        """Return the key of the token of our publisher `number` (from 1): reliable, volatile, keep the last 10."""
        return (
            f"@ros2_lv/{self.domain}/{self.session_id}/0/{number}/MP/%/%/{self.name}/{topic.replace('/', '%')}/"
            f"{_dds_type(kind)}/{_types.hash_rihs01(kind)}/::,10:,:,:,,"
        )


def attachment(sequence: int, time_ns: int, publisher_token: str) -> bytes:
    """Return what rmw_zenoh wants beside every message: number, time and publisher's id, in Zenoh's serialization."""
    gid = hashlib.md5(publisher_token.encode(), usedforsecurity=False).digest()
    return b"".join(
        (
            _text("sequence_number") + struct.pack("<q", sequence),
            _text("source_timestamp") + struct.pack("<q", time_ns),
            _text("source_gid") + bytes((len(gid),)) + gid,
        )
    )


def _text(value: str) -> bytes:
    return bytes((len(value),)) + value.encode()  # a length below 128 is one byte of LEB128


def _dds_type(kind: str) -> str:
    package, _, name = kind.split("/")
    return f"{package}::msg::dds_::{name}_"


def _header(stamp_ns: int, frame: str) -> Any:
    sec, nanosec = divmod(stamp_ns, NANOSECONDS)
    return _Header(stamp=_Time(sec=max(-(2**31), min(sec, 2**31 - 1)), nanosec=nanosec), frame_id=frame)
