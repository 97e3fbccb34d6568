"""glTF 2.0, GLB and VRM files to skinned meshes."""

from __future__ import annotations

from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib as gltf
from PIL import Image

from arm_ik_service.errors import SkinError
from arm_ik_service.geometry import batch
from arm_ik_service.skin.gltf_data import Array, GltfData, widened
from arm_ik_service.skin.mesh import SKIN_COLOUR, Floats, SkinnedMesh, pack_weights, vertex_normals

_TRIANGLES = 4
_TEXTURE_SIZE = 1024  # textures larger than that are reduced: there is one colour a vertex
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
        with np.errstate(invalid="ignore", over="ignore"):  # what is not a number is looked for at the end
            return _Reader(document, GltfData(document, path.parent)).read()
    except SkinError as error:
        raise SkinError(f"{path}: {error}") from error
    except (ArithmeticError, AttributeError, LookupError, MemoryError, TypeError, ValueError) as error:
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
    data: GltfData
    images: dict[int, Array | None] = field(default_factory=dict)

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
            np.concatenate([widened(part.bones, width) for part in parts]),
            np.concatenate([widened(part.weights, width) for part in parts]),
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
        for what, values in (("vertex", mesh.vertices), ("normal", mesh.normals), ("bone", mesh.joints)):
            if not np.isfinite(values).all():
                raise SkinError(f"a {what} of it is at a place that is not a number")
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
            at_rest = at_rest @ self.data.accessor(skin.inverseBindMatrices).reshape(-1, 4, 4).transpose(0, 2, 1)
        attributes = primitive.attributes
        sets = [n for n in range(8) if getattr(attributes, f"JOINTS_{n}", None) is not None]
        if not sets:
            raise SkinError("a mesh of the skin has no JOINTS_0 and WEIGHTS_0")
        local = np.concatenate([self.data.accessor(getattr(attributes, f"JOINTS_{n}")) for n in sets], axis=1)
        given = np.concatenate([self.data.accessor(getattr(attributes, f"WEIGHTS_{n}")) for n in sets], axis=1)
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
        vertices = self.data.accessor(primitive.attributes.POSITION).astype(float)
        count = len(vertices)
        if primitive.indices is None:
            triangles = np.arange(count - count % 3).reshape(-1, 3)
        else:
            triangles = self.data.accessor(primitive.indices).astype(np.int64).reshape(-1, 3)
        if triangles.size and triangles.max() >= count:
            raise SkinError(f"a triangle uses vertex {triangles.max()} of {count}")
        if primitive.attributes.NORMAL is None:
            normals = vertex_normals(vertices, triangles.astype(np.uint32))
        else:
            normals = self.data.accessor(primitive.attributes.NORMAL).astype(float)
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
        """One colour a vertex: the material's colour times its texture there, times COLOR_0."""
        colour = np.tile(np.array(SKIN_COLOUR, float) / 255.0, (count, 1))
        surface = None
        if primitive.material is not None:
            surface = self.document.materials[primitive.material].pbrMetallicRoughness
            factor = (surface.baseColorFactor if surface is not None else None) or (1.0, 1.0, 1.0, 1.0)
            colour = np.tile(np.asarray(factor[:3], float), (count, 1))
        if surface is not None and surface.baseColorTexture is not None:
            texture = surface.baseColorTexture
            places = getattr(primitive.attributes, f"TEXCOORD_{texture.texCoord or 0}", None)
            image = self._image(self.document.textures[texture.index].source)
            if places is not None and image is not None:
                colour = colour * sampled(image, self.data.accessor(places))
        if primitive.attributes.COLOR_0 is not None:
            colour = colour * self.data.accessor(primitive.attributes.COLOR_0)[:, :3]
        return np.round(255.0 * np.clip(colour, 0.0, 1.0)).astype(np.uint8)

    def _image(self, index: int | None) -> Array | None:
        """Return an image (H,W,3), 0..1; None for one in a form that cannot be read: the mesh is there without it."""
        if index is None:
            return None
        if index not in self.images:
            image = self.document.images[index]
            if image.bufferView is not None:
                view = self.document.bufferViews[image.bufferView]
                raw = self.data.view(image.bufferView, 0, np.dtype("u1"), view.byteLength, 1).tobytes()
            else:
                raw = self.data.file(image.uri)
            try:
                with Image.open(BytesIO(raw)) as picture:
                    picture.thumbnail((_TEXTURE_SIZE, _TEXTURE_SIZE))  # finer than vertices are
                    self.images[index] = np.asarray(picture.convert("RGB"), float) / 255.0
            except (OSError, ValueError, Image.DecompressionBombError):
                self.images[index] = None
        return self.images[index]


def sampled(image: Array, places: Array) -> Floats:
    """Colours (V,3) of an image (H,W,3) at texture coordinates (V,2): x right, y down, repeating."""
    height, width = image.shape[:2]
    column = np.clip((places[:, 0] % 1.0) * width, 0, width - 1).astype(np.int64)
    row = np.clip((places[:, 1] % 1.0) * height, 0, height - 1).astype(np.int64)
    return np.asarray(image[row, column])


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
