"""An OBJ mesh with a weights file beside it: `person.obj` and `person.weights.json`.

The weights file says what OBJ cannot:

    {"bones": [{"name": "upperarm_l", "parent": "chest", "joint": [0.18, 1.4, 0.0]}, ...],
     "weights": {"upperarm_l": [[17, 0.5], [18, 1.0], ...], ...}}

Joints are in the units of the OBJ, y up; vertices count from 0 in the order of the OBJ's `v` lines; weights of a vertex
need not sum to 1. Names are understood as those of other avatars are (`names.py`).
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import msgspec
import numpy as np

from arm_ik_service.errors import SkinError
from arm_ik_service.skin.mesh import SKIN_COLOUR, SkinnedMesh, pack_weights, vertex_normals
from arm_ik_service.wire.messages import Vector

MOST_INFLUENCES = 8


class Bone(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One bone at rest."""

    name: str
    joint: Vector
    parent: str | None = None


class WeightsFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What `person.weights.json` holds."""

    bones: list[Bone]
    weights: dict[str, list[tuple[int, float]]]


def read_obj(path: Path) -> tuple[SkinnedMesh, dict[str, int]]:
    """Return the mesh in its own axes, and no humanoid map. Raises SkinError."""
    vertices, triangles = _read_surface(path)
    beside = path.with_suffix(".weights.json")
    try:
        file = msgspec.json.decode(beside.read_bytes(), type=WeightsFile)
    except OSError as error:
        raise SkinError(f"{beside}: {error.strerror}; an OBJ has no bones, so they are read from there") from error
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise SkinError(f"{beside}: {error}") from error
    places = {bone.name: index for index, bone in enumerate(file.bones)}
    for name in (*file.weights, *(bone.parent for bone in file.bones if bone.parent is not None)):
        if name not in places:
            raise SkinError(f"{beside}: bone {name!r} is not listed under bones")
    bones = np.zeros((len(vertices), MOST_INFLUENCES), np.int64)
    weights = np.zeros((len(vertices), MOST_INFLUENCES))
    used = np.zeros(len(vertices), np.int64)
    for name, pairs in file.weights.items():
        for vertex, weight in pairs:
            if not 0 <= vertex < len(vertices):
                raise SkinError(
                    f"{beside}: {name} has a weight for vertex {vertex}, but {path.name} has {len(vertices)}"
                )
            if used[vertex] == MOST_INFLUENCES:
                raise SkinError(f"{beside}: vertex {vertex} is on more than {MOST_INFLUENCES} bones")
            bones[vertex, used[vertex]], weights[vertex, used[vertex]] = places[name], weight
            used[vertex] += 1
    try:
        bones, weights = pack_weights(bones, weights, len(places))
    except SkinError as error:
        raise SkinError(f"{beside}: {error}") from error
    mesh = SkinnedMesh(
        vertices=vertices,
        normals=vertex_normals(vertices, triangles),
        triangles=triangles,
        colours=np.tile(np.array(SKIN_COLOUR, np.uint8), (len(vertices), 1)),
        names=tuple(places),
        parents=tuple(places[bone.parent] if bone.parent is not None else -1 for bone in file.bones),
        joints=np.array([bone.joint for bone in file.bones], float).reshape(-1, 3),
        bones=bones,
        weights=weights,
    )
    return mesh, {}


def _read_surface(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (V,3) and triangles (T,3); polygons are cut into fans, all but `v` and `f` is passed over."""
    vertices: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as error:
        raise SkinError(f"{path}: {error.strerror}") from error
    for number, line in enumerate(lines, 1):
        words = line.split()
        try:
            if words[:1] == ["v"]:
                x, y, z = map(float, words[1:4])
                vertices.append([x, y, z])
            elif words[:1] == ["f"]:
                corners = [int(word.split("/")[0]) for word in words[1:]]
                corners = [corner - 1 if corner > 0 else len(vertices) + corner for corner in corners]
                triangles += [(corners[0], b, c) for b, c in pairwise(corners[1:])]
        except (ValueError, IndexError) as error:
            raise SkinError(f"{path}: line {number} is not OBJ: {line[:60]!r}") from error
    faces = np.array(triangles, np.int64).reshape(-1, 3)
    if not vertices or not len(faces):
        raise SkinError(f"{path}: no surface in it, {len(vertices)} vertices and {len(faces)} triangles")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise SkinError(f"{path}: a face uses a vertex that is not there")
    return np.array(vertices), faces.astype(np.uint32)
