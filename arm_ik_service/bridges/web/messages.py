"""What page and bridge say to each other on the WebSocket: binary MessagePack maps, told apart by their `type`.

A page opens with a Hello and gets a Welcome, or is closed with one of the codes below. Poses are the page's own
WebXR poses; times of frames are already on the bridge's clock (see page/clock.js).
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta, Struct

from arm_ik_service.bridges.hand_joints import grip_from_wrist
from arm_ik_service.errors import DecodeError
from arm_ik_service.wire.messages import (
    ArmsState,
    Counter,
    Nanoseconds,
    Quaternion,
    Side,
    Skeleton,
    Space,
    TrackedPose,
    Vector,
)

PROTOCOL = 1
MAX_MESSAGE_BYTES = 4096  # the largest honest message, a frame, is about 700 bytes

# WebSocket close codes: those of RFC 6455 and IANA, the rest from the private range
MALFORMED = 1008
TOO_LARGE = 1009
RESTART = 1012
WRONG_CODE = 4401
TAKEN_OVER = 4409
TOO_MANY_TRIES = 4429

Text = Annotated[str, Meta(max_length=128)]


class Hello(Struct, frozen=True, tag="hello"):
    """The first message of a page: the code that the bridge printed, or the token of an earlier welcome."""

    protocol: int
    code: Text | None = None
    token: Text | None = None


class Ping(Struct, frozen=True, tag="ping"):
    """Asks for the bridge's time; `page_ms` comes back as it is."""

    page_ms: float


class PagePose(Struct, frozen=True):
    """A WebXR pose with its flags; `joint` says whether a hand is given by its grip or by its wrist joint."""

    position: Vector
    orientation: Quaternion
    flags: Annotated[int, Meta(ge=0, le=15)]
    linear_velocity: Vector | None = None
    angular_velocity: Vector | None = None
    joint: Literal["grip", "wrist"] = "grip"

    def tracked_pose(self, side: Side | None = None) -> TrackedPose:
        """Return the pose as a ControllerFrame carries it: the head, or the grip of the hand of that side."""
        pose = TrackedPose(self.position, self.orientation, self.flags, self.linear_velocity, self.angular_velocity)
        return pose if side is None or self.joint == "grip" else grip_from_wrist(side, pose)


class Frame(Struct, frozen=True, tag="frame"):
    """One sample of headset and hands."""

    seq: Counter
    sample_time_ns: Nanoseconds
    space: Space
    head: PagePose | None
    left: PagePose | None
    right: PagePose | None


FromPage = Hello | Ping | Frame


class Welcome(Struct, frozen=True, tag="welcome"):
    """The page is paired: its avatar, and the token with which it comes back."""

    avatar: str
    token: str


class Pong(Struct, frozen=True, tag="pong"):
    """The answer to a Ping."""

    page_ms: float
    bridge_time_ns: int


class Arms(Struct, frozen=True, tag="arms"):
    """The service's answer to one of the page's frames."""

    state: ArmsState


class Bones(Struct, frozen=True, tag="skeleton"):
    """The lengths to draw with."""

    skeleton: Skeleton


_from_page: Any = msgspec.msgpack.Decoder(FromPage)
encode = msgspec.msgpack.Encoder().encode


def decode(payload: bytes) -> FromPage:
    """Return what a page said. Raises DecodeError naming the path of the field that is wrong."""
    try:
        message: FromPage = _from_page.decode(payload)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise DecodeError(str(error)) from error
    return message
