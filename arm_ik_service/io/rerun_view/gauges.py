"""Where the limits of an arm lie, as lines in space: dials at the joints, the elbow's circle, the shoulder's region.

Dials are arcs from one end of a joint's range to the other with a needle at the angle it has, drawn where the joint is.
Bones have ISB axes on both sides, so rotations about +X and +Y run the other way round on the left.
No Rerun here; all arrays have a row a frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from arm_ik_service.geometry import batch
from arm_ik_service.io.rerun_view.rows import ANGLES, PLACES, Floats
from arm_ik_service.wire.messages import Side, SwingRegion

Flags = npt.NDArray[np.bool_]

ARC_POINTS = 24
DIALS = ("shoulder_twist", "elbow_flexion", "pronation", "wrist_flexion", "wrist_deviation")
RADIUS_M = {
    "shoulder_twist": 0.085,
    "elbow_flexion": 0.11,
    "pronation": 0.075,
    "wrist_flexion": 0.13,
    "wrist_deviation": 0.15,
}
REGION_RADIUS_M = 0.17
BRACKET_M = 0.075  # off the elbow's circle: outside an arm
LEAST_CIRCLE_M = 0.02
SWIVEL_POINTS = 73  # of the circle: every 5 degrees


@dataclass(frozen=True)
class Arm:
    """One arm over N frames: poses (N,7) in world axes, the nine angles (N,9) [rad]."""

    side: Side
    chest: Floats
    upper_arm: Floats
    forearm: Floats
    hand: Floats
    angles: Floats

    @classmethod
    def of(cls, side: Side, values: Floats) -> Arm:
        """Take it out of rows (N, WIDTH)."""
        parts = (values[:, PLACES[f"{side}/{name}"]] for name in ("upper_arm", "forearm", "hand", "angles"))
        return cls(side, values[:, PLACES["chest"]], *parts)


def dial(arm: Arm, name: str, lower: float, upper: float) -> tuple[Floats, Floats]:
    """Arc (N, ARC_POINTS, 3) and needle (N, ARC_POINTS, 3) of the dial of one joint, world axes [m]."""
    now = arm.angles[:, [ANGLES.index(name)]]
    along = np.broadcast_to(np.linspace(lower, upper, ARC_POINTS), (len(now), ARC_POINTS))
    angle = np.concatenate([along, now], axis=1)
    sign = 1.0 if arm.side == "right" else -1.0
    zero = np.zeros_like(angle)
    if name in ("shoulder_twist", "pronation"):
        bone, end, share = (
            (arm.upper_arm, arm.forearm, 0.5) if name == "shoulder_twist" else (arm.forearm, arm.hand, 0.7)
        )
        turned = sign * (angle - now)  # the bone has turned already
        local = np.stack([np.cos(turned), zero, -np.sin(turned)], axis=-1)
        centre = bone[:, :3] + share * (end[:, :3] - bone[:, :3])
    else:
        bone, centre = (
            (arm.upper_arm, arm.forearm[:, :3]) if name == "elbow_flexion" else (arm.forearm, arm.hand[:, :3])
        )
        flexion, aside = angle, zero
        if name == "wrist_deviation":
            flexion, aside = arm.angles[:, [ANGLES.index("wrist_flexion")]], sign * angle
        local = np.stack([np.sin(flexion) * np.cos(aside), -np.cos(flexion) * np.cos(aside), -np.sin(aside)], axis=-1)
    points = centre[:, None] + RADIUS_M[name] * batch.rotate(bone[:, None, 3:], local)
    share_of_needle = np.linspace(0.0, 1.0, ARC_POINTS)[:, None]
    return points[:, :-1], centre[:, None] + share_of_needle * (points[:, -1:] - centre[:, None])


def swing_region(arm: Arm, region: SwingRegion) -> Floats:
    """Closed outline (N, E+1, 3) of the directions the upper arm may take, around the shoulder, world axes [m]."""
    edge = _of_side(arm, [*region.edge, region.edge[0]])
    return arm.upper_arm[:, None, :3] + REGION_RADIUS_M * batch.rotate(arm.chest[:, None, 3:], edge)


def elbow_arc(arm: Arm, swivels: Floats) -> Floats:
    """Where the elbow would be (N,P,3), world axes [m], at swivels (N,P) [rad] about the line from shoulder to wrist.

    They count from where it is.
    """
    centre, out, aside = _elbow_plane(arm)
    turn = swivels[..., None]
    return np.asarray(centre[:, None] + np.cos(turn) * out[:, None] + np.sin(turn) * aside[:, None])


def _elbow_plane(arm: Arm) -> tuple[Floats, Floats, Floats]:
    """Middle of the elbow's circle (N,3), the way from there to the elbow, and the way a quarter turn on [m]."""
    shoulder, elbow, wrist = arm.upper_arm[:, :3], arm.forearm[:, :3], arm.hand[:, :3]
    axis = batch.normalized(wrist - shoulder)
    centre = shoulder + np.sum((elbow - shoulder) * axis, axis=1, keepdims=True) * axis
    out = elbow - centre
    return centre, out, np.cross(axis, out)


def elbow_bracket(arm: Arm, ends: Floats) -> Floats:
    """A bracket (N, SWIVEL_POINTS, 3) around a stretch of the elbow's circle, between the swivels `ends` (N,2) [rad].

    It stands off the circle, which runs inside the arm where the elbow is. Where the circle is hardly one, as that of
    a straight arm, it is a point.
    """
    share = np.linspace(0.0, 1.0, SWIVEL_POINTS - 2)
    swivels = ends[:, :1] + share * (ends[:, 1:] - ends[:, :1])
    centre, out, _ = _elbow_plane(arm)
    radius = np.linalg.norm(out, axis=1)
    wider = np.where(radius > LEAST_CIRCLE_M, 1.0 + BRACKET_M / np.maximum(radius, LEAST_CIRCLE_M), 0.0)
    feet = elbow_arc(arm, ends)
    arc = centre[:, None] + wider[:, None, None] * (elbow_arc(arm, swivels) - centre[:, None])
    feet = np.where(wider[:, None, None] > 0.0, feet, centre[:, None])
    return np.concatenate([feet[:, :1], arc, feet[:, 1:]], axis=1)


def elbow_circle(arm: Arm, region: SwingRegion | None) -> tuple[Floats, Floats, Floats]:
    """Circle (N, SWIVEL_POINTS, 3) on which the elbow can go, the part of it around the elbow that the shoulder lets
    it reach (as many points), and a line (N, SWIVEL_POINTS, 3) from its middle to the elbow; world axes [m].
    """
    shoulder, (centre, out, _) = arm.upper_arm[:, :3], _elbow_plane(arm)
    swivel = np.linspace(-np.pi, np.pi, SWIVEL_POINTS)
    circle = elbow_arc(arm, np.broadcast_to(swivel, (len(centre), SWIVEL_POINTS)))
    free: Flags = np.ones(circle.shape[:2], bool)
    if region is not None:
        away = batch.rotate(batch.conjugate(arm.chest[:, None, 3:]), circle - shoulder[:, None])
        free = inside(region, batch.normalized(_of_side(arm, away)))
    middle = SWIVEL_POINTS // 2  # where the elbow is
    ahead = np.cumprod(free[:, middle + 1 :], axis=1).sum(axis=1)
    behind = np.cumprod(free[:, :middle][:, ::-1], axis=1).sum(axis=1)
    place = np.clip(np.arange(SWIVEL_POINTS), (middle - behind)[:, None], (middle + ahead)[:, None])
    reachable = np.take_along_axis(circle, place[:, :, None], axis=1)
    spoke = centre[:, None] + np.linspace(0.0, 1.0, SWIVEL_POINTS)[:, None] * out[:, None]
    return circle, reachable, spoke


def inside(region: SwingRegion, directions: Floats) -> Flags:
    """Whether unit directions (..., 3) of a right arm lie in the region."""
    centre, edge = np.array(region.centre), np.array(region.edge)
    aside = batch.normalized(edge[0] - (edge[0] @ centre) * centre)  # azimuth 0
    up = np.cross(centre, aside)
    if (edge[1] @ up) < 0.0:
        up = -up
    azimuth = np.arctan2(directions @ up, directions @ aside)
    corners = np.linspace(0.0, 2.0 * np.pi, len(edge) + 1)
    away = np.arccos(np.clip(np.append(edge @ centre, edge[0] @ centre), -1.0, 1.0))
    allowed = np.interp(azimuth % (2.0 * np.pi), corners, away)
    return np.array(np.arccos(np.clip(directions @ centre, -1.0, 1.0)) <= allowed)


def _of_side(arm: Arm, directions: object) -> Floats:
    """Directions of a right arm as those of this one, and back."""
    return np.asarray(directions, float) * (1.0 if arm.side == "right" else (-1.0, 1.0, 1.0))
