"""The area of a mesh's cross-sections, followed through a deformation."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from arm_ik_service.skin.mesh import Floats, SkinnedMesh


def section_area(
    mesh: SkinnedMesh, vertices: Floats, point: Floats, normal: Floats, chosen: npt.NDArray[np.bool_]
) -> float:
    """Area [m2] now of the section that the plane through `point` cut out of the `chosen` vertices' part at rest.

    The section is an outline of skin: it is cut where the mesh is at rest, followed to where `vertices` are, and its
    area is that of the surface it spans, half the sum of a x b along it.
    """
    triangles = mesh.triangles[chosen[mesh.triangles].all(axis=1)]
    height = (mesh.vertices - point) @ normal
    total = np.zeros(3)
    middle = vertices[np.unique(triangles)].mean(axis=0)
    for one in triangles[(height[triangles].min(axis=1) < 0.0) & (height[triangles].max(axis=1) >= 0.0)]:
        crossing = {}
        for a, b in zip(one, np.roll(one, -1), strict=True):
            if (height[a] < 0.0) != (height[b] < 0.0):
                part = height[a] / (height[a] - height[b])
                crossing[height[a] < 0.0] = vertices[a] + part * (vertices[b] - vertices[a])
        total += 0.5 * np.cross(crossing[True] - middle, crossing[False] - middle)
    return float(np.linalg.norm(total))
