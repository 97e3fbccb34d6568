"""glTF 2.0, GLB and VRM files to and from skinned meshes. The only importer of pygltflib."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt
import pygltflib as gltf

from arm_ik_service.errors import SkinError
from arm_ik_service.geometry import batch
from arm_ik_service.skin.mesh import SKIN_COLOUR, Floats, SkinnedMesh, pack_weights, vertex_normals

Array = npt.NDArray[Any]

_COMPONENTS: dict[int, str] = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_TRIANGLES = 4
_COMPRESSED = {"KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"}


def read_gltf(path: Path) -> tuple[SkinnedMesh, dict[str, int]]:
    """Return everything in the file that moves with bones, in its rest pose and its own axes, and VRM's humanoid map.

    The rest pose is that of the file's nodes, A or T or any other. The map is empty in a file that is not a VRM.
    Raises SkinError.
    """
    try:
        with path.open("rb") as file:
            binary = file.read(4) == b"glTF"  # a VRM is a GLB, whatever its name ends with
        document = gltf.GLTF2().load_binary(str(path)) if binary else gltf.GLTF2().load_json(str(path))
    except OSError as error:
        raise SkinError(f"{path}: {error.strerror}") from error
    except Exception as error:  # pygltflib lets through whatever struct, json and dataclasses raise
        raise SkinError(f"{path}: not a glTF, GLB or VRM file ({type(error).__name__}: {error})") from error
    if document is None:
        raise SkinError(f"{path}: not a glTF, GLB or VRM file")
    try:
        return _Reader(document, path).read()
    except SkinError as error:
        raise SkinError(f"{path}: {error}") from error
    except (IndexError, KeyError, TypeError, ValueError) as error:
        raise SkinError(f"{path}: broken glTF, an index or a size in it does not fit ({error})") from error


@dataclass
class _Part:
    """One primitive at rest."""

    vertices: Floats
    normals: Floats
    triangles: Array
    colours: Array
    bones: Array
    weights: Floats


@dataclass
class _Reader:
    document: Any
    path: Path
    buffers: dict[int, bytes] = field(default_factory=dict)

    def read(self) -> tuple[SkinnedMesh, dict[str, int]]:
        nodes = self.document.nodes
        compressed = _COMPRESSED & set(self.document.extensionsRequired or ())
        if compressed:
            raise SkinError(f"it is compressed with {', '.join(sorted(compressed))}: export it without compression")
        if not self.document.skins:
            raise SkinError(
                "no skin in it, so no vertex is bound to a bone: export the mesh together with its armature"
            )
        parents = [-1] * len(nodes)
        for index, node in enumerate(nodes):
            for child in node.children or ():
                parents[child] = index
        poses = _world_matrices(nodes, parents)
        joints = {j for one in self.document.skins for j in one.joints}
        parts = [
            part
            for index, node in enumerate(nodes)
            if node.mesh is not None
            for part in self._parts(index, node, poses, joints, parents)
        ]
        if not parts:
            raise SkinError("no mesh in it is bound to its skin")
        width = max(part.bones.shape[1] for part in parts)
        starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
        bones, weights = pack_weights(
            np.concatenate([_widened(part.bones, width) for part in parts]),
            np.concatenate([_widened(part.weights, width) for part in parts]),
            len(nodes),
        )
        mesh = SkinnedMesh(
            vertices=np.concatenate([part.vertices for part in parts]),
            normals=np.concatenate([part.normals for part in parts]),
            triangles=np.concatenate([p.triangles + start for p, start in zip(parts, starts[:-1], strict=True)]).astype(
                np.uint32
            ),
            colours=np.concatenate([part.colours for part in parts]),
            names=tuple(node.name or f"node {index}" for index, node in enumerate(nodes)),
            parents=tuple(parents),
            joints=poses[:, :3, 3].copy(),
            bones=bones,
            weights=weights,
        )
        return mesh, _humanoid_map(self.document.extensions or {})

    def _parts(self, index: int, node: Any, poses: Floats, joints: set[int], parents: list[int]) -> list[_Part]:
        primitives = self.document.meshes[node.mesh].primitives
        if node.skin is not None:
            return [self._skinned(primitive, self.document.skins[node.skin], poses) for primitive in primitives]
        carrier = index
        while carrier >= 0 and carrier not in joints:
            carrier = parents[carrier]
        if carrier < 0:
            return []  # scenery: it hangs on no bone
        return [self._rigid(primitive, poses[index], carrier) for primitive in primitives]

    def _skinned(self, primitive: Any, skin: Any, poses: Floats) -> _Part:
        part = self._rigid(primitive, np.eye(4), 0)
        at_rest = poses[skin.joints]
        if skin.inverseBindMatrices is not None:
            at_rest = at_rest @ self.accessor(skin.inverseBindMatrices).reshape(-1, 4, 4).transpose(0, 2, 1)
        attributes = primitive.attributes
        sets = [n for n in range(8) if getattr(attributes, f"JOINTS_{n}", None) is not None]
        if not sets:
            raise SkinError("a mesh of the skin has no JOINTS_0 and WEIGHTS_0")
        local = np.concatenate([self.accessor(getattr(attributes, f"JOINTS_{n}")) for n in sets], axis=1)
        given = np.concatenate([self.accessor(getattr(attributes, f"WEIGHTS_{n}")) for n in sets], axis=1)
        local, weights = pack_weights(local.astype(np.int64), given, len(skin.joints))
        blended = np.einsum("vk,vkij->vij", weights, at_rest[local])
        part.vertices = np.einsum("vij,vj->vi", blended[:, :3, :3], part.vertices) + blended[:, :3, 3]
        normals = np.einsum("vij,vj->vi", blended[:, :3, :3], part.normals)
        part.normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        part.bones, part.weights = np.asarray(skin.joints, np.int64)[local], weights
        return part

    def _rigid(self, primitive: Any, pose: Floats, carrier: int) -> _Part:
        if primitive.mode not in (None, _TRIANGLES):
            raise SkinError("a mesh is not made of single triangles: export it triangulated")
        if primitive.attributes.POSITION is None:
            raise SkinError("a mesh has no vertex positions")
        vertices = self.accessor(primitive.attributes.POSITION).astype(float)
        count = len(vertices)
        if primitive.indices is None:
            triangles = np.arange(count - count % 3).reshape(-1, 3)
        else:
            triangles = self.accessor(primitive.indices).astype(np.int64).reshape(-1, 3)
        if triangles.size and triangles.max() >= count:
            raise SkinError(f"a triangle uses vertex {triangles.max()} of {count}")
        if primitive.attributes.NORMAL is None:
            normals = vertex_normals(vertices, triangles.astype(np.uint32))
        else:
            normals = self.accessor(primitive.attributes.NORMAL).astype(float)
        normals = normals @ pose[:3, :3].T
        return _Part(
            vertices=vertices @ pose[:3, :3].T + pose[:3, 3],
            normals=normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12),
            triangles=triangles,
            colours=self._colours(primitive, count),
            bones=np.full((count, 1), carrier, np.int64),
            weights=np.ones((count, 1)),
        )

    def _colours(self, primitive: Any, count: int) -> Array:
        """One colour a vertex: the material's factor times COLOR_0. Textures are not looked at."""
        if primitive.material is None:
            colour = np.tile(np.array(SKIN_COLOUR, float) / 255.0, (count, 1))
        else:
            surface = self.document.materials[primitive.material].pbrMetallicRoughness
            factor = (surface.baseColorFactor if surface is not None else None) or (1.0, 1.0, 1.0, 1.0)
            colour = np.tile(np.asarray(factor[:3], float), (count, 1))
        if primitive.attributes.COLOR_0 is not None:
            colour = colour * self.accessor(primitive.attributes.COLOR_0)[:, :3]
        return np.round(255.0 * np.clip(colour, 0.0, 1.0)).astype(np.uint8)

    def accessor(self, index: int) -> Array:
        """Return an accessor as (count, width); normalised integers as their fractions."""
        accessor = self.document.accessors[index]
        dtype = np.dtype("<" + _COMPONENTS[accessor.componentType])
        width, count = _WIDTHS[accessor.type], accessor.count
        if accessor.bufferView is None:
            values = np.zeros((count, width), dtype)
        else:
            values = self._view(accessor.bufferView, accessor.byteOffset or 0, dtype, count, width)
        if accessor.sparse is not None:
            places, changes = accessor.sparse.indices, accessor.sparse.values
            kind = np.dtype("<" + _COMPONENTS[places.componentType])
            changed = accessor.sparse.count
            at = self._view(places.bufferView, places.byteOffset or 0, kind, changed, 1)[:, 0]
            values = values.copy()
            values[at] = self._view(changes.bufferView, changes.byteOffset or 0, dtype, changed, width)
        if accessor.normalized:
            values = np.maximum(values / np.iinfo(dtype).max, -1.0)
        return values

    def _view(self, index: int, offset: int, dtype: np.dtype[Any], count: int, width: int) -> Array:
        view = self.document.bufferViews[index]
        row = dtype.itemsize * width
        stride = view.byteStride or row
        start = (view.byteOffset or 0) + offset
        raw = self._buffer(view.buffer)
        if count and start + (count - 1) * stride + row > len(raw):
            raise SkinError(
                f"the file ends early: {len(raw)} bytes where {start + (count - 1) * stride + row} are needed"
            )
        return np.ndarray((count, width), dtype, raw, start, (stride, dtype.itemsize))

    def _buffer(self, index: int) -> bytes:
        if index not in self.buffers:
            uri = self.document.buffers[index].uri
            if uri is None:
                self.buffers[index] = self.document.binary_blob() or b""
            elif uri.startswith("data:"):
                self.buffers[index] = self.document.get_data_from_buffer_uri(uri)
            else:
                beside = self.path.parent / unquote(uri)
                try:
                    self.buffers[index] = beside.read_bytes()
                except OSError as error:
                    raise SkinError(f"its data file {beside}: {error.strerror}") from error
        return self.buffers[index]


def _widened(values: Array, width: int) -> Array:
    return np.pad(values, ((0, 0), (0, width - values.shape[1])))


def _world_matrices(nodes: list[Any], parents: list[int]) -> Floats:
    local = np.tile(np.eye(4), (len(nodes), 1, 1))
    for index, node in enumerate(nodes):
        if node.matrix is not None:
            local[index] = np.reshape(node.matrix, (4, 4)).T
            continue
        local[index, :3, :3] = batch.matrix(node.rotation or (0.0, 0.0, 0.0, 1.0)) * np.asarray(node.scale or (1, 1, 1))
        local[index, :3, 3] = node.translation or (0.0, 0.0, 0.0)
    world = local.copy()
    for index in range(len(nodes)):
        above, steps = parents[index], 0
        while above >= 0:
            world[index] = local[above] @ world[index]
            above, steps = parents[above], steps + 1
            if steps > len(nodes):
                raise SkinError("its nodes are their own ancestors")
    return world


def _humanoid_map(extensions: dict[str, Any]) -> dict[str, int]:
    """Role -> node of VRM 1.0 (VRMC_vrm) or of VRM 0.x (VRM), whose names for arms and hands are the same."""
    if "VRMC_vrm" in extensions:
        bones = extensions["VRMC_vrm"]["humanoid"]["humanBones"]
        return {role: int(bone["node"]) for role, bone in bones.items()}
    if "VRM" in extensions:
        bones = extensions["VRM"]["humanoid"]["humanBones"]
        return {str(bone["bone"]): int(bone["node"]) for bone in bones}
    return {}


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
            count=values.size // _WIDTHS[kind],
            type=kind,
            normalized=normalized,
        )
        if kind == "VEC3":
            accessor.min, accessor.max = values.min(axis=0).tolist(), values.max(axis=0).tolist()
        document.accessors.append(accessor)
        chunks.append(data + b"\0" * (-len(data) % 4))
        return len(document.accessors) - 1

    def four(values: Array, kind: Any) -> Array:
        return _widened(values, 4).astype(kind)

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
