"""glTF, GLB and VRM files as the format allows them, and what is said of those that cannot be used."""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from arm_ik_service.errors import SkinError
from arm_ik_service.geometry import batch
from arm_ik_service.skin.builtin import built_in_arms
from arm_ik_service.skin.gltf import read_gltf
from arm_ik_service.skin.gltf_writer import write_glb
from arm_ik_service.skin.load import load_avatar

Document = dict[str, Any]


@pytest.fixture(scope="module")
def arms(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("gltf") / "arms.glb"
    write_glb(built_in_arms(), path)
    return path


def taken_apart(path: Path) -> tuple[Document, bytes]:
    """The two chunks of a GLB, by the specification: 12 bytes, then length, type and data of each."""
    data = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    more, kind = struct.unpack_from("<I4s", data, 20 + size)
    assert kind == b"BIN\0"
    return json.loads(data[20 : 20 + size]), data[28 + size : 28 + size + more]


def put_together(path: Path, document: Document, binary: bytes) -> Path:
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return path


def changed(arms: Path, folder: Path, change: Callable[[Document], None]) -> Path:
    document, binary = taken_apart(arms)
    change(document)
    return put_together(folder / "changed.glb", document, binary)


def attribute(document: Document, name: str) -> Document:
    accessor = document["accessors"][document["meshes"][0]["primitives"][0]["attributes"][name]]
    assert isinstance(accessor, dict)
    return accessor


def same_shape(a: Path, b: Path, factor: float = 1.0) -> None:
    """Assert that two files hold the same mesh and joints, the second one `factor` times as large."""
    one, other = read_gltf(a)[0], read_gltf(b)[0]
    np.testing.assert_allclose(other.vertices, factor * one.vertices, atol=1e-6 * factor)
    np.testing.assert_allclose(other.normals, one.normals, atol=1e-5)
    bones = [other.names.index(name) for name in one.names]
    np.testing.assert_allclose(other.joints[bones], factor * one.joints, atol=1e-6 * factor)


def test_what_we_write_is_what_the_specification_says(arms: Path) -> None:
    document, binary = taken_apart(arms)
    mesh, view = built_in_arms(), document["bufferViews"]
    accessor = attribute(document, "POSITION")
    at = view[accessor["bufferView"]].get("byteOffset", 0)
    positions = np.frombuffer(binary, "<f4", 3 * accessor["count"], at).reshape(-1, 3)
    np.testing.assert_allclose(positions, mesh.vertices, atol=1e-6)
    np.testing.assert_allclose(accessor["min"], positions.min(axis=0), atol=1e-6)
    weights = attribute(document, "WEIGHTS_0")
    at = view[weights["bufferView"]].get("byteOffset", 0)
    np.testing.assert_allclose(
        np.frombuffer(binary, "<f4", 4 * weights["count"], at).reshape(-1, 4).sum(axis=1), 1.0, atol=1e-6
    )
    assert len(document["skins"][0]["joints"]) == len(mesh.names)


def test_a_scaled_armature_gives_the_size_that_is_seen(arms: Path, tmp_path: Path) -> None:
    """An export in centimetres: root scaled by 0.01, everything below it a hundred times as large."""

    def scale(document: Document) -> None:
        nodes = document["nodes"]
        document["nodes"] = [*nodes, {"name": "armature", "scale": [0.5] * 3, "children": [0]}]
        document["scenes"][0]["nodes"] = [len(nodes), len(nodes) - 1]

    same_shape(arms, changed(arms, tmp_path, scale), factor=0.5)


def test_a_node_s_matrix_is_read_column_by_column(arms: Path, tmp_path: Path) -> None:
    def as_matrix(document: Document) -> None:
        for node in document["nodes"][1:4]:
            x, y, z = node.pop("translation")
            node["matrix"] = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1]

    same_shape(arms, changed(arms, tmp_path, as_matrix))


def test_the_rest_pose_is_that_of_the_nodes_not_of_the_binding(arms: Path, tmp_path: Path) -> None:
    """A file whose bones were turned after binding is at rest as its nodes show it."""
    turn = batch.exp(np.array([0.0, 0.0, 0.4]))

    def turned(document: Document) -> None:
        names = [node.get("name") for node in document["nodes"]]
        document["nodes"][names.index("rightLowerArm")]["rotation"] = turn.tolist()

    before, after = read_gltf(arms)[0], read_gltf(changed(arms, tmp_path, turned))[0]
    elbow, hand = before.names.index("rightLowerArm"), before.names.index("rightHand")
    carried = (before.bones[:, 0] == hand) & (before.weights[:, 0] > 0.9999)
    around = before.joints[elbow]
    np.testing.assert_allclose(
        after.vertices[carried], around + batch.rotate(turn, before.vertices[carried] - around), atol=1e-5
    )


def test_data_may_lie_in_the_text_or_in_a_file_beside_it(arms: Path, tmp_path: Path) -> None:
    document, binary = taken_apart(arms)
    document["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(binary).decode()
    inside = tmp_path / "inside.gltf"
    inside.write_text(json.dumps(document))
    same_shape(arms, inside)
    document["buffers"][0]["uri"] = "the%20data.bin"
    beside = tmp_path / "beside.gltf"
    beside.write_text(json.dumps(document))
    (tmp_path / "the data.bin").write_bytes(binary)
    same_shape(arms, beside)
    (tmp_path / "the data.bin").unlink()
    with pytest.raises(SkinError, match=r"the data\.bin: No such file"):
        read_gltf(beside)


def test_sparse_accessors_and_weights_as_bytes_are_understood(arms: Path, tmp_path: Path) -> None:
    document, binary = taken_apart(arms)
    mesh = built_in_arms()
    place, moved = 5, np.array([[0.1, 0.2, 0.3]], "<f4")
    attribute(document, "POSITION")["sparse"] = {
        "count": 1,
        "indices": {"bufferView": len(document["bufferViews"]), "componentType": 5123},
        "values": {"bufferView": len(document["bufferViews"]) + 1},
    }
    four = np.round(255.0 * np.pad(mesh.weights, ((0, 0), (0, 4 - mesh.weights.shape[1])))).astype("u1")
    for data in (np.array([place], "<u2").tobytes() + b"\0\0", moved.tobytes(), four.tobytes()):
        document["bufferViews"].append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(data)})
        binary += data
    weights = attribute(document, "WEIGHTS_0")
    weights |= {"bufferView": len(document["bufferViews"]) - 1, "componentType": 5121, "normalized": True}
    document["buffers"][0]["byteLength"] = len(binary)
    read = read_gltf(put_together(tmp_path / "sparse.glb", document, binary))[0]
    np.testing.assert_allclose(read.vertices[place], moved[0], atol=1e-6)
    np.testing.assert_allclose(np.delete(read.vertices, place, 0), np.delete(mesh.vertices, place, 0), atol=1e-6)
    np.testing.assert_allclose(read.weights[:, 0], mesh.weights[:, 0], atol=0.5 / 255 + 1e-6)


@pytest.mark.parametrize("version", ["VRMC_vrm", "VRM"])
def test_a_vrm_s_own_map_of_bones_is_used(arms: Path, tmp_path: Path, version: str) -> None:
    names = built_in_arms().names
    bones = {name: names.index(name) for name in names if name.endswith(("Arm", "Hand"))}

    def disguise(document: Document) -> None:
        for index, node in enumerate(document["nodes"]):
            node["name"] = f"bone.{index:03d}"
        human = (
            {role: {"node": node} for role, node in bones.items()}
            if version == "VRMC_vrm"
            else [{"bone": role, "node": node} for role, node in bones.items()]
        )
        document["extensions"] = {version: {"humanoid": {"humanBones": human}}}
        document["extensionsUsed"] = [version]

    path = changed(arms, tmp_path, disguise).rename(tmp_path / "person.vrm")
    assert read_gltf(path)[1] == bones
    assert load_avatar(path).arms["left"].elbow[0] < -0.3


@pytest.mark.parametrize("form", ["PNG", "JPEG", "broken"])
def test_a_vertex_has_the_colour_of_its_texture_there(arms: Path, tmp_path: Path, form: str) -> None:
    """Left half red, right half blue; an image that cannot be read leaves the material's own colour."""
    document, binary = taken_apart(arms)
    picture = np.zeros((32, 64, 3), np.uint8)
    picture[:, :32, 0], picture[:, 32:, 2] = 255, 255
    data = BytesIO()
    Image.fromarray(picture).save(data, "PNG" if form == "broken" else form)
    image = data.getvalue()[: 40 if form == "broken" else None]
    size = len(built_in_arms().vertices)
    u = np.where(np.arange(size) % 2, 1.75, 0.25)  # a texture repeats
    places = np.stack([u, np.full(size, 0.5)], axis=-1).astype("<f4").tobytes()
    views = len(document["bufferViews"])
    document["bufferViews"] += [
        {"buffer": 0, "byteOffset": len(binary), "byteLength": len(places)},
        {"buffer": 0, "byteOffset": len(binary) + len(places), "byteLength": len(image)},
    ]
    document["accessors"].append({"bufferView": views, "componentType": 5126, "count": size, "type": "VEC2"})
    attributes = document["meshes"][0]["primitives"][0]["attributes"]
    attributes["TEXCOORD_0"] = len(document["accessors"]) - 1
    del attributes["COLOR_0"]
    document["images"], document["textures"] = [{"bufferView": views + 1, "mimeType": "image/png"}], [{"source": 0}]
    document["materials"][0]["pbrMetallicRoughness"] |= {"baseColorTexture": {"index": 0}}
    document["buffers"][0]["byteLength"] = len(binary) + len(places) + len(image)
    colours = read_gltf(put_together(tmp_path / "x.glb", document, binary + places + image))[0].colours
    even, odd = ([255, 255, 255],) * 2 if form == "broken" else ([255, 0, 0], [0, 0, 255])
    np.testing.assert_allclose(colours[::2], np.tile(even, (size // 2, 1)), atol=3)
    np.testing.assert_allclose(colours[1::2], np.tile(odd, (size // 2, 1)), atol=3)


def test_a_rigid_mesh_on_a_bone_moves_with_that_bone(arms: Path, tmp_path: Path) -> None:
    """A watch: a mesh without skin, child of the hand's node."""

    def watch(document: Document) -> None:
        names = [node.get("name") for node in document["nodes"]]
        primitive = dict(document["meshes"][0]["primitives"][0])
        primitive["attributes"] = {k: primitive["attributes"][k] for k in ("POSITION", "NORMAL")}
        document["meshes"].append({"primitives": [primitive]})
        document["nodes"].append({"name": "watch", "mesh": 1, "scale": [0.1] * 3})
        hand = document["nodes"][names.index("rightHand")]
        hand["children"] = [*hand.get("children", []), len(names)]

    mesh = read_gltf(changed(arms, tmp_path, watch))[0]
    count = len(built_in_arms().vertices)
    assert len(mesh.vertices) == 2 * count
    hand = mesh.names.index("rightHand")
    assert (mesh.bones[count:, 0] == hand).all()
    np.testing.assert_allclose(mesh.vertices[count:], mesh.joints[hand] + 0.1 * built_in_arms().vertices, atol=1e-6)


def no_skin(document: Document) -> None:
    del document["skins"]
    for node in document["nodes"]:
        node.pop("skin", None)


def unnamed(document: Document) -> None:
    for node in document["nodes"]:
        node["name"] = "thing"


def points_elsewhere(document: Document) -> None:
    document["skins"][0]["joints"][1] = 10_000


def too_long(document: Document) -> None:
    attribute(document, "POSITION")["count"] = 10**7


def compressed(document: Document) -> None:
    document["extensionsRequired"] = ["KHR_draco_mesh_compression"]


def strips(document: Document) -> None:
    document["meshes"][0]["primitives"][0]["mode"] = 5


def circle(document: Document) -> None:
    document["nodes"][2]["children"] = [1]


def weightless(document: Document) -> None:
    document["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = zeros(document)


def nowhere(document: Document) -> None:
    document["nodes"][1]["translation"] = [0.0, 1e400, 0.0]


def headless(document: Document) -> None:
    document["accessors"][0] = None


def zeros(document: Document) -> int:
    """Index of an accessor of zeros, as wide as weights."""
    count = attribute(document, "POSITION")["count"]
    document["accessors"].append({"componentType": 5126, "count": count, "type": "VEC4"})
    return len(document["accessors"]) - 1


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (no_skin, "no skin in it"),
        (unnamed, "no bone found for leftUpperArm"),
        (points_elsewhere, "broken glTF"),
        (too_long, "the file ends early: .* bytes where 1200"),
        (compressed, "compressed with KHR_draco_mesh_compression: export it without compression"),
        (strips, "not made of single triangles"),
        (circle, "their own ancestors"),
        (nowhere, "at a place that is not a number"),
        (headless, "broken glTF"),
        (weightless, "vertex 0 has no weight, so no bone would move it"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_in_one_line_that_names_it(
    arms: Path, tmp_path: Path, change: Callable[[Document], None], said: str
) -> None:
    path = changed(arms, tmp_path, change)
    with pytest.raises(SkinError, match=said) as caught:
        load_avatar(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"glTF", b"hello, world", b"{}", b"[1, 2]", b"\xff" * 64])
@pytest.mark.parametrize("suffix", [".glb", ".gltf", ".vrm"])
def test_what_is_no_gltf_is_refused(tmp_path: Path, content: bytes, suffix: str) -> None:
    path = tmp_path / f"some{suffix}"
    path.write_bytes(content)
    with pytest.raises(SkinError) as caught:
        load_avatar(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kept", [0.3, 0.999])
def test_a_file_that_was_cut_off_is_refused(arms: Path, tmp_path: Path, kept: float) -> None:
    data = arms.read_bytes()
    path = tmp_path / "cut.glb"
    path.write_bytes(data[: int(kept * len(data))])
    with pytest.raises(SkinError):
        load_avatar(path)


def test_a_file_that_is_not_there_and_a_format_that_is_not_ours_are_named(tmp_path: Path) -> None:
    with pytest.raises(SkinError, match=r"nobody\.glb: No such file"):
        load_avatar(tmp_path / "nobody.glb")
    with pytest.raises(SkinError, match=r"person\.fbx: avatars are \.glb, \.gltf, \.vrm or \.obj"):
        load_avatar(tmp_path / "person.fbx")


def test_a_folder_that_cannot_be_written_is_an_error_of_ours(tmp_path: Path) -> None:
    with pytest.raises(SkinError, match="nowhere"):
        write_glb(built_in_arms(), tmp_path / "nowhere" / "arms.glb")
