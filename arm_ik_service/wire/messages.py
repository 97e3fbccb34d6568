"""The published messages, version 1. Metres, radians, seconds; times are integer nanoseconds; quaternions x y z w.

World axes are OpenXR's: right-handed, +X right, +Y up, -Z forward. A field may be added within a version; readers
ignore what they do not know. Anything else is a new version.
"""

from __future__ import annotations

from typing import Annotated, Literal, get_args

from msgspec import Meta, Struct

VERSION = 1

Nanoseconds = Annotated[int, Meta(ge=-(2**62), le=2**62)]
Counter = Annotated[int, Meta(ge=0, le=2**62)]
Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

# XrSpaceLocationFlagBits (OpenXR 1.1, 7.3)
ORIENTATION_VALID = 1
POSITION_VALID = 2
ORIENTATION_TRACKED = 4
POSITION_TRACKED = 8
FULLY_TRACKED = ORIENTATION_VALID | POSITION_VALID | ORIENTATION_TRACKED | POSITION_TRACKED

Space = Literal["stage", "local_floor", "local"]
TrackingState = Literal["lost", "held", "inferred", "tracked"]
TRACKING_STATES: tuple[TrackingState, ...] = get_args(TrackingState)  # from the worst to the best
Encoding = Literal["msgpack", "json"]
Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")


class TrackedPose(Struct, frozen=True):
    """A device at the frame's sample time: the head (VIEW space) or a hand (grip pose)."""

    position: Vector
    orientation: Quaternion
    flags: Annotated[int, Meta(ge=0, le=2**31 - 1)] = FULLY_TRACKED
    linear_velocity: Vector | None = None
    angular_velocity: Vector | None = None


class ControllerFrame(Struct, frozen=True):
    """One sample of headset and controllers, on `avatar/<id>/controllers`. A device that is absent is null."""

    version: int
    seq: Counter
    sample_time_ns: Nanoseconds  # the (predicted) time the poses are of; velocities are taken against it
    publish_time_ns: Nanoseconds  # the sender's wall clock when it put the frame
    space: Space
    head: TrackedPose | None
    left: TrackedPose | None
    right: TrackedPose | None


class Pose(Struct, frozen=True):
    """A frame in world axes."""

    position: Vector
    orientation: Quaternion


class JointAngles(Struct, frozen=True):
    """The nine joint angles [rad], or their rates [rad/s]. Signs are equal on both sides; see models/README.md."""

    shoulder_flexion: float  # rotation vector of the swing: part about the lateral axis
    shoulder_abduction: float  # rotation vector of the swing: part about the anterior axis, away from the body
    shoulder_twist: float  # about the humerus, internal positive
    elbow_flexion: float
    elbow_carrying: float
    pronation: float
    wrist_flexion: float
    wrist_deviation: float
    wrist_axial: float


class IsbShoulder(Struct, frozen=True):
    """The shoulder in ISB's Y-X-Y angles [rad] (Wu et al. 2005); plane and rotation mean little where `singular`."""

    plane_of_elevation: float
    elevation: float
    axial_rotation: float
    singular: bool


class Bones(Struct, frozen=True):
    """World poses of the segments at their proximal joints. The hand is OpenXR's wrist frame, the others ISB axes."""

    clavicle: Pose
    upper_arm: Pose
    forearm: Pose
    hand: Pose


class ArmState(Struct, frozen=True):
    """One arm. `configuration` and `velocity` are Pinocchio's q (10) and v (9) of models/human_arm.xml."""

    tracking: TrackingState  # the worse of the two below
    position_tracking: TrackingState
    orientation_tracking: TrackingState
    configuration: tuple[float, ...]
    velocity: tuple[float, ...]
    angles: JointAngles
    angle_rates: JointAngles
    isb_shoulder: IsbShoulder
    bones: Bones
    position_error_m: float
    orientation_error_rad: float
    reach_ratio: float  # distance shoulder to wrist asked for, over the length of the straight arm
    iterations: int
    limits: tuple[str, ...]  # names of the limits the arm rests on
    elbow_confidence: float  # 0: any swivel is as comfortable; 1: the comfort is sharp


class ArmsHeader(Struct, frozen=True):
    """Which frame an answer is to, and when it passed where; `seq` and `sample_time_ns` are the frame's."""

    version: int
    avatar: str
    seq: Counter
    sample_time_ns: Nanoseconds
    receive_time_ns: Nanoseconds  # the service's wall clock when the frame reached it
    solve_time_ns: Nanoseconds  # a duration: decode to solved
    publish_time_ns: Nanoseconds  # the service's wall clock when it put this message


class ArmsState(ArmsHeader, frozen=True):
    """The answer to one ControllerFrame, on `avatar/<id>/arms`."""

    chest: Pose
    head: Pose
    left: ArmState
    right: ArmState


class JointLimit(Struct, frozen=True):
    """The range [rad] of one of the angles of JointAngles."""

    name: str
    lower: float
    upper: float


class SwingRegion(Struct, frozen=True):
    """The directions a humerus may take, in chest axes, of the right arm; the left's have their x negated.

    Star-shaped: on the great circle from `centre` to a point of `edge` every direction is inside.
    """

    centre: Vector
    edge: tuple[Vector, ...]  # evenly spaced in azimuth around the centre


class Skeleton(Struct, frozen=True):
    """What does not change from frame to frame, on `avatar/<id>/skeleton`: lengths [m] and limits.

    Published when an avatar is first heard, when it is measured, and when lengths that are learnt have changed by 1 %.
    """

    version: int
    avatar: str
    stature_m: float
    shoulder_width_m: float
    upper_arm_m: float
    forearm_m: float
    hand_m: float
    joint_limits: tuple[JointLimit, ...]
    limit_names: tuple[str, ...]  # every name that can stand in ArmState.limits
    left_wrist_from_grip: Pose = Pose((0.0, -0.02, -0.075), (0.5, -0.5, -0.5, 0.5))  # OpenXR's grip in its wrist frame
    right_wrist_from_grip: Pose = Pose((0.0, -0.02, -0.075), (0.5, 0.5, 0.5, 0.5))
    shoulder_swing: SwingRegion | None = None  # what `shoulder_flexion` and `shoulder_abduction` together are held to


class AvatarHealth(Struct, frozen=True):
    """One avatar of a service; rate, share and latency are of the last period, counts since it was taken on."""

    avatar: str
    frames_per_s: float
    answered: int
    overtaken: int  # frames that a newer one replaced before they were solved
    refused: int
    silent_s: float  # time since its last frame
    answered_share: float = 1.0  # of the frames that arrived; under overload it is the same for everybody
    latency_max_ms: float = 0.0  # receive to publish
    position_error_m: float = 0.0  # of the worse hand, in the last answer
    tracking: TrackingState = "lost"  # of the worse hand, in the last answer


class Health(Struct, frozen=True):
    """The state of one service, once a second on `arm_ik/<service>/health`. Counters run since the start."""

    version: int
    service: str
    software: str
    time_ns: Nanoseconds
    uptime_s: float
    answered: int
    overtaken: int
    refused: dict[str, int]  # cause -> count
    latency_p50_ms: float  # receive to publish, over the last period
    latency_p99_ms: float
    avatars: tuple[AvatarHealth, ...]
    answered_share: float = 1.0  # of all frames of the last period
    services: tuple[str, ...] = ()  # those that share the avatars, as this one sees it
    memory_bytes: int = 0  # resident; 0 where the system does not say
