"""A triangle mesh bound to bones, at rest: what every avatar file becomes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from arm_ik_service.errors import SkinError

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

SKIN_COLOUR = (226, 186, 160)


@dataclass(frozen=True)
class SkinnedMesh:
    """Bones are known by name and joint only: how they turn is said by motions from rest, so their axes do not matter.

    `weights` are positive, decrease along a row, are followed by zeros and sum to 1: build them with `pack_weights`.
    """

    vertices: Floats  # (V,3) [m]
    normals: Floats  # (V,3) unit
    triangles: npt.NDArray[np.uint32]  # (T,3)
    colours: npt.NDArray[np.uint8]  # (V,3)
    names: tuple[str, ...]  # (B,) of the bones
    parents: tuple[int, ...]  # (B,) -1 for a root; a parent comes before or after its children
    joints: Floats  # (B,3) where each bone turns [m]
    bones: Integers  # (V,K) indices of the bones that carry a vertex
    weights: Floats  # (V,K)


def pack_weights(bones: npt.ArrayLike, weights: npt.ArrayLike, bone_count: int) -> tuple[Integers, Floats]:
    """Return influences (V,K) as SkinnedMesh holds them: largest first, summing to 1, as few columns as will do.

    A bone may stand in a row several times. Raises SkinError for weights that are not finite, negative or all zero, and
    for bones that are not there.
    """
    b, w = np.array(bones, np.int64), np.array(weights, float)
    _refuse(~np.isfinite(w).all(axis=1), "a weight that is not a number")
    _refuse((w < 0.0).any(axis=1), "a negative weight")
    _refuse(((w > 0.0) & ((b < 0) | (b >= bone_count))).any(axis=1), f"a bone outside 0..{bone_count - 1}")
    total = w.sum(axis=1, keepdims=True)
    _refuse(total[:, 0] < 1e-6, "no weight, so no bone would move it")
    w /= total
    b[w == 0.0] = -1
    order = np.argsort(b, axis=1, kind="stable")  # equal bones side by side, to be added up
    b, w = np.take_along_axis(b, order, 1), np.take_along_axis(w, order, 1)
    for k in range(b.shape[1] - 1, 0, -1):
        same = b[:, k] == b[:, k - 1]
        w[same, k - 1] += w[same, k]
        w[same, k] = 0.0
    order = np.argsort(-w, axis=1, kind="stable")
    b, w = np.take_along_axis(b, order, 1), np.take_along_axis(w, order, 1)
    used = max(int((w > 0.0).sum(axis=1).max()), 1)
    b[w == 0.0] = 0
    return np.ascontiguousarray(b[:, :used]), np.ascontiguousarray(w[:, :used])


def _refuse(broken: Any, what: str) -> None:
    if broken.any():
        raise SkinError(f"vertex {int(np.argmax(broken))} has {what} ({int(broken.sum())} of {len(broken)} vertices)")


def vertex_normals(vertices: Floats, triangles: npt.NDArray[np.uint32]) -> Floats:
    """Normals (V,3) as the sum of those of the adjoining triangles, by their areas."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    faces = np.cross(b - a, c - a)
    normals = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(normals, triangles[:, k], faces)
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12))
