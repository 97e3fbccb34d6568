"""The calibration profile: a person's measures and how the grips sit in the hands. TOML, readable, written by hand or
by `arm-ik calibrate`.

What is missing is derived from stature with the ratios of Drillis & Contini (1966), in Winter, Biomechanics and Motor
Control of Human Movement, table 4.1.
"""

from __future__ import annotations

import math
from typing import Annotated

import msgspec
from msgspec import Meta

from arm_ik_service.wire.messages import Quaternion, Vector

Length = Annotated[float, Meta(gt=0.0, lt=2.0)]

UPPER_ARM_PER_STATURE = 0.186
FOREARM_PER_STATURE = 0.146
HAND_PER_STATURE = 0.108
SHOULDER_WIDTH_PER_STATURE = 0.206  # between the glenohumeral joints: the biacromial 0.23 less the deltoid's depth


class BodyMeasures(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Lengths of one person [m]; None means: derive it from stature."""

    stature_m: Annotated[float, Meta(ge=0.5, le=2.6)] = 1.75
    upper_arm_m: Length | None = None
    forearm_m: Length | None = None
    hand_m: Length | None = None
    shoulder_width_m: Length | None = None

    @property
    def upper_arm(self) -> float:
        """Glenohumeral joint to elbow [m]."""
        return self.upper_arm_m or UPPER_ARM_PER_STATURE * self.stature_m

    @property
    def forearm(self) -> float:
        """Elbow to wrist [m]."""
        return self.forearm_m or FOREARM_PER_STATURE * self.stature_m

    @property
    def hand(self) -> float:
        """Wrist to fingertip [m]."""
        return self.hand_m or HAND_PER_STATURE * self.stature_m

    @property
    def shoulder_width(self) -> float:
        """Between the two glenohumeral joints [m]."""
        return self.shoulder_width_m or SHOULDER_WIDTH_PER_STATURE * self.stature_m


class GripOffset(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """wrist_from_grip: the grip pose in the OpenXR wrist frame of its hand (-Z to the fingers, +Y out of the back)."""

    position_m: Vector
    orientation_xyzw: Quaternion


class Grips(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Default: palm centroid 75 mm along the hand and 20 mm to its palm side; axes as OpenXR defines the grip pose."""

    left: GripOffset = GripOffset((0.0, -0.02, -0.075), (0.5, -0.5, -0.5, 0.5))
    right: GripOffset = GripOffset((0.0, -0.02, -0.075), (0.5, 0.5, 0.5, 0.5))


# Poses whose -Z points out of the fist like a sword: Beat Saber's sabers, WebVR controllers, OpenXR's aim more or less.
# On recordings of both, the elbow lies on +Z: the hand's orientation is met to 0.1 degrees with these, to 20 without.
POINTING_GRIPS = Grips(
    left=GripOffset((0.0, -0.02, -0.075), (0.0, 0.0, -math.sqrt(0.5), math.sqrt(0.5))),
    right=GripOffset((0.0, -0.02, -0.075), (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))),
)

Range = tuple[float, float]


class RangesOfMotion(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Joint ranges of one person [degrees], lower and upper; None keeps the model's. Signs: models/README.md."""

    shoulder_twist: Range | None = None
    elbow_flexion: Range | None = None
    elbow_carrying: Range | None = None
    pronation: Range | None = None
    wrist_flexion: Range | None = None
    wrist_deviation: Range | None = None
    wrist_axial: Range | None = None

    def __post_init__(self) -> None:
        """Refuse a range that is upside down, by name."""
        for name, limits in self.stated():
            if not -180.0 <= limits[0] <= limits[1] <= 180.0:
                raise ValueError(
                    f"{name} = [{limits[0]:g}, {limits[1]:g}]: lower must not be above upper, in -180..180"
                )

    def stated(self) -> list[tuple[str, Range]]:
        """Return the ranges that are given."""
        every = ((name, getattr(self, name)) for name in self.__struct_fields__)
        return [(name, limits) for name, limits in every if limits is not None]

    def in_radians(self) -> dict[str, Range]:
        """Return the given ranges as ArmModel.load takes them [rad]."""
        return {name: (math.radians(lower), math.radians(upper)) for name, (lower, upper) in self.stated()}


class Profile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One person, calibrated or assumed."""

    body: BodyMeasures = BodyMeasures()
    grip: Grips = Grips()
    limits_deg: RangesOfMotion = RangesOfMotion()
