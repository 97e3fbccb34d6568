"""BVH: both arms with their clavicles and the head, on a root at the chest; for Blender and every animation tool.

Metres, y up, a person who faces -z: Blender's import settings as they come, at life size. Joints have Unity's humanoid
names. The offsets are a T-pose (see `axes.py`), so all rotations are zero there. Every joint has position channels too,
which replace its offset, as animation tools read them: shoulders slide on their clavicles, and the measures of a person
who is not calibrated are learned while they move. Tools that take rotations only get the lengths of the first state.

BVH has one frame time. Frames are written one a state; a pause in the recording holds the last pose, and where states
come closer together than the frame time some are left out, so that the motion never runs ahead or behind by more than
`SLACK` frames. The file is written as the states come: memory does not grow with the session.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from statistics import median

from arm_ik_service.body.profile import HAND_PER_STATURE, UPPER_ARM_PER_STATURE
from arm_ik_service.errors import SessionError
from arm_ik_service.exports.axes import bvh_euler_deg
from arm_ik_service.exports.posture import Joint, Posture, in_parent, posture_of
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.scalar import Quaternion, Vector
from arm_ik_service.wire.messages import SIDES, ArmsState

PROBE = 256  # states from which the frame time is taken: their median interval
SLACK = 1.5  # frames, with the recording's own frame time: jitter then moves no state out of its frame
RESAMPLING_SLACK = 0.5  # frames, with a frame rate that was asked for
COUNT_WIDTH = 10  # digits kept free for the number of frames, known at the end only
MOST_HELD = 36_000  # frames that one pause may fill; a longer one is a clock that was set

CHANNELS = "Xposition Yposition Zposition Zrotation Xrotation Yrotation"
ARM = ("Shoulder", "UpperArm", "LowerArm", "Hand")
HEAD_M = 0.1  # length that the head's bone is drawn with


class BvhWriter:
    """One person's motion being written; closing it, even early, leaves a whole file."""

    def __init__(self, path: Path, fps: float | None = None) -> None:
        """Create the file. `fps` None keeps the pace of the recording. Raises SessionError if it cannot be written."""
        self.path = path
        self.frame_count = 0
        self._frame_s = None if fps is None else 1.0 / fps
        self._slack = SLACK if fps is None else RESAMPLING_SLACK
        self._probe: list[ArmsState] = []
        self._time_s, self._last_ns = 0.0, 0
        self._line = ""
        self._angles: dict[str, Vector] = {}
        try:
            self._file = path.open("w", encoding="ascii", newline="\n")
        except OSError as error:
            raise SessionError(f"{path}: cannot be written: {error.strerror}") from error

    def add(self, state: ArmsState) -> None:
        """Add one state of the person."""
        if self._count_at is None:
            self._probe.append(state)
            if len(self._probe) == PROBE or self._frame_s is not None:
                self._begin()
            return
        self._write(state)

    def close(self) -> None:
        """Write what is left and the number of frames."""
        if self._file.closed:
            return
        with self._file:
            if self._count_at is None and self._probe:
                self._begin()
            if self._count_at is not None:
                self._file.seek(self._count_at)
                self._file.write(f"{self.frame_count:<{COUNT_WIDTH}}")

    _count_at: int | None = None  # where in the file the number of frames goes; None until the header is there

    def _begin(self) -> None:
        states, self._probe = self._probe, []
        if self._frame_s is None:
            steps = [b.sample_time_ns - a.sample_time_ns for a, b in pairwise(states)]
            forward = [step for step in steps if step > 0]
            self._frame_s = 1e-9 * median(forward) if forward else 1.0 / 90.0
        self._file.write(_hierarchy(posture_of(states[0])))
        self._file.write("MOTION\nFrames: ")
        self._count_at = self._file.tell()
        self._file.write(f"{0:<{COUNT_WIDTH}}\nFrame Time: {self._frame_s:.9f}\n")
        self._last_ns = states[0].sample_time_ns
        for state in states:
            self._write(state)

    def _write(self, state: ArmsState) -> None:
        """Write a state into the frame that is its time's, and the last one into those that have none."""
        assert self._frame_s is not None
        self._time_s += max(0, state.sample_time_ns - self._last_ns) * 1e-9
        self._last_ns = state.sample_time_ns
        behind = self._time_s / self._frame_s - self.frame_count
        if behind <= -self._slack:
            return
        if behind >= self._slack:
            missing = round(behind)
            if missing > MOST_HELD:
                self._time_s -= (missing - MOST_HELD) * self._frame_s
                missing = MOST_HELD
            for _ in range(missing):
                self._file.write(self._line)
            self.frame_count += missing
        self._line = self._motion(posture_of(state))
        self._file.write(self._line)
        self.frame_count += 1

    def _motion(self, posture: Posture) -> str:
        """Return the line of channels, joints in the order of the hierarchy."""
        numbers: list[float] = []
        for name, joint in _local_joints(posture):
            numbers += joint.position
            numbers += self._euler(name, joint.rotation)
        return " ".join([f"{number:.6f}" for number in numbers]) + "\n"

    def _euler(self, joint: str, q: Quaternion) -> Vector:
        """Return the channels of a rotation, nearest to those of the frame before: curves without jumps."""
        angles = bvh_euler_deg(q)
        before = self._angles.get(joint)
        if before is not None:
            z, x, y = angles
            angles = min(
                (_unwrapped(before, candidate) for candidate in (angles, (z + 180.0, 180.0 - x, y + 180.0))),
                key=lambda candidate: g.norm(g.subtract(candidate, before)),
            )
        self._angles[joint] = angles
        return angles


def _unwrapped(before: Vector, angles: Vector) -> Vector:
    """Add whole turns [deg] to come nearest to `before`."""
    z, x, y = (
        angle - 360.0 * math.floor((angle - last) / 360.0 + 0.5) for angle, last in zip(angles, before, strict=True)
    )
    return (z, x, y)


def _local_joints(posture: Posture) -> Iterator[tuple[str, Joint]]:
    """Give every joint in its parent, in the order of the hierarchy."""
    chest = posture.chest
    yield "Chest", chest
    yield "Head", in_parent(chest, posture.head)
    for side, arm in posture.arms():
        for bone, parent, joint in zip(ARM, (chest, *arm), arm, strict=False):
            yield f"{side.capitalize()}{bone}", in_parent(parent, joint)


def _hierarchy(first: Posture) -> str:
    """Return the tree: lengths of the first state, in a T-pose."""
    places = {name: joint.position for name, joint in _local_joints(first)}
    lines = ["HIERARCHY", "ROOT Chest", "{", *_joint(1, (0.0, 0.0, 0.0))]
    lines += [
        "  JOINT Head",
        "  {",
        *_joint(2, (0.0, g.norm(places["Head"]), 0.0)),
        *_end(2, (0.0, HEAD_M, 0.0)),
        "  }",
    ]
    for side in SIDES:
        name, outwards = side.capitalize(), -1.0 if side == "left" else 1.0
        upper_arm_m, forearm_m = g.norm(places[f"{name}LowerArm"]), g.norm(places[f"{name}Hand"])
        hand_m = upper_arm_m * HAND_PER_STATURE / UPPER_ARM_PER_STATURE
        offsets: list[Vector] = [
            places[f"{name}Shoulder"],
            places[f"{name}UpperArm"],
            (outwards * upper_arm_m, 0.0, 0.0),
            (outwards * forearm_m, 0.0, 0.0),
        ]
        for depth, (bone, offset) in enumerate(zip(ARM, offsets, strict=True), 1):
            lines += [f"{'  ' * depth}JOINT {name}{bone}", "  " * depth + "{", *_joint(depth + 1, offset)]
        lines += _end(len(ARM) + 1, (outwards * hand_m, 0.0, 0.0))
        lines += ["  " * depth + "}" for depth in range(len(ARM), 0, -1)]
    return "\n".join([*lines, "}", ""])


def _joint(depth: int, offset: Vector) -> list[str]:
    indent = "  " * depth
    return [f"{indent}OFFSET {offset[0]:.6f} {offset[1]:.6f} {offset[2]:.6f}", f"{indent}CHANNELS 6 {CHANNELS}"]


def _end(depth: int, offset: Vector) -> list[str]:
    indent = "  " * depth
    place = f"{indent}  OFFSET {offset[0]:.6f} {offset[1]:.6f} {offset[2]:.6f}"
    return [f"{indent}End Site", indent + "{", place, indent + "}"]
