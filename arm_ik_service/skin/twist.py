"""Twist spread over a bone: the forearm turns little at the elbow and wholly at the wrist, as radius around ulna.

A bone is replaced by several on the same axis that take growing shares of its twist. Without that all of the twist sits
in one joint, and the mesh is wrung like a sweet's wrapper.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from arm_ik_service.geometry import batch
from arm_ik_service.skin.mesh import Floats, Integers, SkinnedMesh, pack_weights

SEGMENTS = 7  # of 90 degrees of twist 15 from one to the next: linear blending then loses under 1 % of the area
UNSURE = 0.2  # a twist is not spread where this small cosines of half angles say that its share is ambiguous


@dataclass(frozen=True)
class TwistSegments:
    """The bones that stand in for one: `bones` (S,) indices, with `shares` (S,) of the twist, 0 to 1."""

    bones: Integers
    shares: Floats


def split(mesh: SkinnedMesh, bone: int, end: Floats, segments: int = SEGMENTS) -> tuple[SkinnedMesh, TwistSegments]:
    """Divide the weights of `bone` among segments between its joint and `end` (3); new bones come last.

    `bone` itself becomes the segment that takes the whole twist. One segment leaves the mesh as it is.
    """
    count = len(mesh.names)
    start = mesh.joints[bone]
    place = np.clip(along(mesh.vertices, start, end), 0.0, 1.0) * (segments - 1)
    below = np.minimum(place.astype(np.int64), max(segments - 2, 0))
    upper_share = place - below if segments > 1 else np.ones(len(place))
    bones = np.array([*range(count, count + segments - 1), bone])

    mine = mesh.bones == bone
    carried = np.where(mine, mesh.weights, 0.0).sum(axis=1)
    kept = np.where(mine, 0.0, mesh.weights)
    packed, weights = pack_weights(
        np.column_stack([mesh.bones, bones[below], bones[np.minimum(below + 1, segments - 1)]]),
        np.column_stack([kept, carried * (1.0 - upper_share), carried * upper_share]),
        count + segments - 1,
    )
    added = segments - 1
    mesh = replace(
        mesh,
        bones=packed,
        weights=weights,
        names=(*mesh.names, *(f"{mesh.names[bone]}Twist{k}" for k in range(added))),
        parents=(*mesh.parents, *[mesh.parents[bone]] * added),
        joints=np.concatenate([mesh.joints, np.repeat(start[None], added, axis=0)]),
    )
    return mesh, TwistSegments(bones, np.linspace(0.0, 1.0, segments) if segments > 1 else np.ones(1))


def along(points: Floats, start: Floats, end: Floats) -> Floats:
    """How far along the line from `start` (0) to `end` (1) points (...,3) lie."""
    return np.asarray((points - start) @ (end - start) / np.sum((end - start) ** 2))


def share_twist(parent: Floats, child: Floats, axis: Floats, shares: Floats) -> Floats:
    """Rotations (N,S,4) of segments between that of the parent (N,4) and that of the child (N,4).

    Both are rotations from rest; `axis` (3) is the child's bone at rest. With share 0 the bone points where the child's
    does and has not turned about itself; with share 1 it is the child. Where the bone points nearly opposite to rest,
    or is twisted by nearly half a turn, "not turned" has no meaning: there all segments go over into the child.
    """
    relative = batch.multiply(batch.conjugate(parent), child)
    along, w = relative[:, :3] @ axis, relative[:, 3]
    swing_cosine = np.hypot(along, w)  # of half the angle
    angle = 2.0 * np.arctan2(along, w)
    angle = (angle + np.pi) % (2.0 * np.pi) - np.pi
    sure = _smooth(swing_cosine / UNSURE) * _smooth(np.abs(np.cos(0.5 * angle)) / UNSURE)
    back = (sure * angle)[:, None] * (1.0 - shares)
    turn = np.zeros((*back.shape, 4))
    turn[..., :3] = -np.sin(0.5 * back)[..., None] * axis
    turn[..., 3] = np.cos(0.5 * back)
    return batch.multiply(child[:, None, :], turn)


def _smooth(x: Floats) -> Floats:
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(x * x * (3.0 - 2.0 * x))
