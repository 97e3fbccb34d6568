"""Skinned meshes to GLB files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pygltflib as gltf

from arm_ik_service.errors import SkinError
from arm_ik_service.skin.gltf_data import WIDTHS, Array, widened
from arm_ik_service.skin.mesh import SkinnedMesh


def write_glb(mesh: SkinnedMesh, path: Path) -> None:
    """Write a mesh with its bones as a GLB, at most four bones a vertex. Raises SkinError."""
    if mesh.bones.shape[1] > 4:
        raise SkinError(f"{mesh.bones.shape[1]} bones on a vertex: a GLB of ours has room for 4")
    chunks: list[bytes] = []
    document = gltf.GLTF2(asset=gltf.Asset(version="2.0", generator="arm-ik-service"))

    def add(values: Array, kind: str, component: int, target: int | None = None, *, normalized: bool = False) -> int:
        data = np.ascontiguousarray(values).tobytes()
        document.bufferViews.append(
            gltf.BufferView(buffer=0, byteOffset=sum(map(len, chunks)), byteLength=len(data), target=target)
        )
        accessor = gltf.Accessor(
            bufferView=len(document.bufferViews) - 1,
            componentType=component,
            count=values.size // WIDTHS[kind],
            type=kind,
            normalized=normalized,
        )
        if kind == "VEC3":
            accessor.min, accessor.max = values.min(axis=0).tolist(), values.max(axis=0).tolist()
        document.accessors.append(accessor)
        chunks.append(data + b"\0" * (-len(data) % 4))
        return len(document.accessors) - 1

    def four(values: Array, kind: Any) -> Array:
        return widened(values, 4).astype(kind)

    inverse_bind = np.tile(np.eye(4, dtype=np.float32), (len(mesh.names), 1, 1))
    inverse_bind[:, 3, :3] = -mesh.joints  # column-major
    attributes = gltf.Attributes(
        POSITION=add(mesh.vertices.astype(np.float32), "VEC3", 5126, 34962),
        NORMAL=add(mesh.normals.astype(np.float32), "VEC3", 5126, 34962),
        COLOR_0=add(np.pad(mesh.colours, ((0, 0), (0, 1)), constant_values=255), "VEC4", 5121, 34962, normalized=True),
        JOINTS_0=add(four(mesh.bones, np.uint8), "VEC4", 5121, 34962),
        WEIGHTS_0=add(four(mesh.weights, np.float32), "VEC4", 5126, 34962),
    )
    indices = add(mesh.triangles.reshape(-1), "SCALAR", 5125, 34963)
    matrices = add(inverse_bind, "MAT4", 5126)
    for bone, name in enumerate(mesh.names):
        above = mesh.parents[bone]
        offset = mesh.joints[bone] - (mesh.joints[above] if above >= 0 else 0.0)
        children = [child for child, parent in enumerate(mesh.parents) if parent == bone]
        document.nodes.append(gltf.Node(name=name, translation=offset.tolist(), children=children))
    roots = [bone for bone, parent in enumerate(mesh.parents) if parent < 0]
    document.nodes.append(gltf.Node(name="mesh", mesh=0, skin=0))
    surface = gltf.PbrMetallicRoughness(baseColorFactor=[1.0, 1.0, 1.0, 1.0], metallicFactor=0.0, roughnessFactor=0.8)
    document.materials.append(gltf.Material(pbrMetallicRoughness=surface))
    document.meshes.append(gltf.Mesh(primitives=[gltf.Primitive(attributes=attributes, indices=indices, material=0)]))
    document.skins.append(gltf.Skin(joints=list(range(len(mesh.names))), inverseBindMatrices=matrices))
    document.scenes.append(gltf.Scene(nodes=[*roots, len(mesh.names)]))
    document.scene = 0
    document.buffers.append(gltf.Buffer(byteLength=sum(map(len, chunks))))
    document.set_binary_blob(b"".join(chunks))
    try:
        document.save_binary(str(path))
    except OSError as error:
        raise SkinError(f"{path}: {error.strerror}") from error
