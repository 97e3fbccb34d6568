"""Whether the joints of an arm lie in its mesh, and where they should.

The vertices that two bones share lie around the joint between them: their middle is where the joint looks to be. Some
files hold arms that turn about points beside their own mesh (the shapes of a body were changed and its bones were not);
an elbow would then swing like a flail.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from arm_ik_service.skin.mesh import Floats, SkinnedMesh
from arm_ik_service.wire.messages import SIDES


def joints_in_mesh(mesh: SkinnedMesh, roles: Mapping[str, int]) -> tuple[Floats, list[str]]:
    """Return the joints (B,3) with misplaced arms moved into the mesh, and a line about each arm that was moved.

    An arm is moved as a whole, from the shoulder joint to the fingers, by the mean offset of elbow and wrist, and only
    where one of these lies farther from the middle of its seam than the seam's vertices do.
    """
    joints, notes = mesh.joints.copy(), []
    for side in SIDES:
        offsets, outside = [], False
        for inner, outer in (("UpperArm", "LowerArm"), ("LowerArm", "Hand")):
            seam = _seam(mesh, roles[side + inner], roles[side + outer])
            if seam is not None:
                middle, radius = seam
                offsets.append(middle - mesh.joints[roles[side + outer]])
                outside |= bool(np.linalg.norm(offsets[-1]) > radius)
        if outside:
            offset = np.mean(offsets, axis=0)
            joints[_below(mesh, roles[f"{side}UpperArm"])] += offset
            notes.append(
                f"the bones of its {side} arm lie {100.0 * np.linalg.norm(offset):.1f} cm beside it: moved into it"
            )
    return joints, notes


def _seam(mesh: SkinnedMesh, inner: int, outer: int) -> tuple[Floats, float] | None:
    """Middle (3) of the vertices that both bones carry, and their root mean square distance from it; None if few."""
    shared = np.prod([np.where(mesh.bones == b, mesh.weights, 0.0).sum(axis=1) for b in (inner, outer)], axis=0)
    total = shared.sum()
    if np.count_nonzero(shared) < 8 or total < 0.1:
        return None
    middle = shared @ mesh.vertices / total
    return middle, float(np.sqrt(shared @ np.sum((mesh.vertices - middle) ** 2, axis=1) / total))


def _below(mesh: SkinnedMesh, bone: int) -> list[int]:
    """The bone and all that hang on it."""
    found = [bone]
    for one in found:
        found += [child for child, parent in enumerate(mesh.parents) if parent == one]
    return found
