"""Skinning: where the vertices of a mesh go when its bones move.

A motion (7,) x y z qx qy qz qw takes points of a bone from where they are at rest to where they are now. Linear
blending averages the motions as matrices: cheap, known to all, and losing volume where a joint bends or twists far.
Dual quaternions average them as rigid motions (Kavan, Collins, Zara, O'Sullivan 2008, "Geometric skinning with
approximate dual quaternion blending"): nothing collapses, a far bend bulges a little.
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from arm_ik_service.compiled import compiled
from arm_ik_service.skin.mesh import Floats, SkinnedMesh

Skinning = Literal["linear", "dual_quaternion"]


def skin(
    mesh: SkinnedMesh,
    motions: npt.ArrayLike,
    how: Skinning = "dual_quaternion",
    out: tuple[Floats, Floats] | None = None,
) -> tuple[Floats, Floats]:
    """Return vertices and normals (V,3) of the mesh with bones moved by `motions` (B,7), written to `out` if given."""
    given = np.ascontiguousarray(motions, float)
    if given.shape != (len(mesh.names), 7):
        raise ValueError(f"motions of shape {given.shape}: one pose (7,) for each of {len(mesh.names)} bones is needed")
    vertices, normals = out or (np.empty_like(mesh.vertices), np.empty_like(mesh.normals))
    blend = linear_blend if how == "linear" else dual_quaternion_blend
    blend(mesh.vertices, mesh.normals, mesh.bones, mesh.weights, given, vertices, normals)
    return vertices, normals


@compiled
def linear_blend(vertices: Any, normals: Any, bones: Any, weights: Any, motions: Any, moved: Any, turned: Any) -> None:
    """Fill `moved` (V,3) and `turned` (V,3), unit. Displacements are averaged, so that no motion is exactly none."""
    # rows of (rotation - 1 | translation), 12 a bone
    maps = np.empty((len(motions), 12))
    for b in range(len(motions)):
        tx, ty, tz, x, y, z, w = motions[b]
        row = maps[b]
        row[0], row[1], row[2], row[3] = -2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w), tx
        row[4], row[5], row[6], row[7] = 2.0 * (x * y + z * w), -2.0 * (x * x + z * z), 2.0 * (y * z - x * w), ty
        row[8], row[9], row[10], row[11] = 2.0 * (x * z - y * w), 2.0 * (y * z + x * w), -2.0 * (x * x + y * y), tz
    m = np.empty(12)
    for v in range(len(vertices)):
        m[:] = 0.0
        for k in range(weights.shape[1]):
            weight = weights[v, k]
            if weight == 0.0:
                break
            row = maps[bones[v, k]]
            for i in range(12):
                m[i] += weight * row[i]
        x, y, z = vertices[v, 0], vertices[v, 1], vertices[v, 2]
        moved[v, 0] = x + (m[0] * x + m[1] * y + m[2] * z + m[3])
        moved[v, 1] = y + (m[4] * x + m[5] * y + m[6] * z + m[7])
        moved[v, 2] = z + (m[8] * x + m[9] * y + m[10] * z + m[11])
        x, y, z = normals[v, 0], normals[v, 1], normals[v, 2]
        nx = x + (m[0] * x + m[1] * y + m[2] * z)
        ny = y + (m[4] * x + m[5] * y + m[6] * z)
        nz = z + (m[8] * x + m[9] * y + m[10] * z)
        s = 1.0 / max(math.sqrt(nx * nx + ny * ny + nz * nz), 1e-12)
        turned[v, 0], turned[v, 1], turned[v, 2] = s * nx, s * ny, s * nz


@compiled
def dual_quaternion_blend(
    vertices: Any, normals: Any, bones: Any, weights: Any, motions: Any, moved: Any, turned: Any
) -> None:
    """Fill `moved` (V,3) and `turned` (V,3). Of q and -q the one nearer to the first bone's is averaged."""
    duals = np.empty((len(motions), 8))
    for b in range(len(motions)):
        tx, ty, tz, x, y, z, w = motions[b]
        row = duals[b]
        row[0], row[1], row[2], row[3] = x, y, z, w
        row[4] = 0.5 * (tx * w + ty * z - tz * y)
        row[5] = 0.5 * (ty * w + tz * x - tx * z)
        row[6] = 0.5 * (tz * w + tx * y - ty * x)
        row[7] = -0.5 * (tx * x + ty * y + tz * z)
    q = np.empty(8)
    for v in range(len(vertices)):
        q[:] = 0.0
        pivot = duals[bones[v, 0]]
        for k in range(weights.shape[1]):
            weight = weights[v, k]
            if weight == 0.0:
                break
            row = duals[bones[v, k]]
            if pivot[0] * row[0] + pivot[1] * row[1] + pivot[2] * row[2] + pivot[3] * row[3] < 0.0:
                weight = -weight
            for i in range(8):
                q[i] += weight * row[i]
        s = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        x, y, z, w = s * q[0], s * q[1], s * q[2], s * q[3]
        ex, ey, ez, ew = s * q[4], s * q[5], s * q[6], s * q[7]
        tx = 2.0 * (w * ex - ew * x + y * ez - z * ey)
        ty = 2.0 * (w * ey - ew * y + z * ex - x * ez)
        tz = 2.0 * (w * ez - ew * z + x * ey - y * ex)
        px, py, pz = vertices[v, 0], vertices[v, 1], vertices[v, 2]
        cx, cy, cz = 2.0 * (y * pz - z * py), 2.0 * (z * px - x * pz), 2.0 * (x * py - y * px)
        moved[v, 0] = px + (w * cx + y * cz - z * cy + tx)
        moved[v, 1] = py + (w * cy + z * cx - x * cz + ty)
        moved[v, 2] = pz + (w * cz + x * cy - y * cx + tz)
        px, py, pz = normals[v, 0], normals[v, 1], normals[v, 2]
        cx, cy, cz = 2.0 * (y * pz - z * py), 2.0 * (z * px - x * pz), 2.0 * (x * py - y * px)
        turned[v, 0] = px + (w * cx + y * cz - z * cy)
        turned[v, 1] = py + (w * cy + z * cx - x * cz)
        turned[v, 2] = pz + (w * cz + x * cy - y * cx)
