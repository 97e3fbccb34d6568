"""An OBJ with a weights file beside it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from arm_ik_service.errors import SkinError
from arm_ik_service.skin.builtin import built_in_arms
from arm_ik_service.skin.load import load_avatar
from arm_ik_service.skin.obj import read_obj


def write_arms(folder: Path) -> Path:
    """The built-in arms as an OBJ and its weights."""
    mesh, path = built_in_arms(), folder / "arms.obj"
    lines = [f"v {x:.7f} {y:.7f} {z:.7f}" for x, y, z in mesh.vertices]
    lines += [f"f {a}//{a} {b}//{b} {c}//{c}" for a, b, c in mesh.triangles + 1]
    path.write_text("# arms\no arms\n" + "\n".join(lines) + "\n")
    weights: dict[str, list[tuple[int, float]]] = {name: [] for name in mesh.names}
    for v in range(len(mesh.vertices)):
        for bone, weight in zip(mesh.bones[v], mesh.weights[v], strict=True):
            if weight > 0.0:
                weights[mesh.names[bone]].append((v, 2.0 * float(weight)))  # their sum is not 1: it need not be
    bones = [
        {"name": name, "joint": joint.tolist(), "parent": mesh.names[parent] if parent >= 0 else None}
        for name, joint, parent in zip(mesh.names, mesh.joints, mesh.parents, strict=True)
    ]
    (folder / "arms.weights.json").write_text(json.dumps({"bones": bones, "weights": weights}))
    return path


def test_arms_written_as_obj_and_weights_are_the_same_character(tmp_path: Path) -> None:
    path = write_arms(tmp_path)
    mesh, ours = read_obj(path)[0], built_in_arms()
    np.testing.assert_allclose(mesh.vertices, ours.vertices, atol=1e-7)
    np.testing.assert_array_equal(mesh.triangles, ours.triangles)
    np.testing.assert_allclose(mesh.weights, ours.weights, atol=1e-12)
    assert load_avatar(path).arms["right"].wrist[0] > 0.5


def small(folder: Path, faces: str = "f 1 2 3 4\n", **weights: Any) -> Path:
    path = folder / "small.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n" + faces)
    file = {"bones": [{"name": "a", "joint": [0, 0, 0]}], "weights": {"a": [[v, 1.0] for v in range(4)]}} | weights
    (folder / "small.weights.json").write_text(json.dumps(file))
    return path


def test_polygons_become_fans_and_vertices_may_be_counted_from_the_end(tmp_path: Path) -> None:
    assert read_obj(small(tmp_path))[0].triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert read_obj(small(tmp_path, "f -4 -3 -2\n"))[0].triangles.tolist() == [[0, 1, 2]]
    assert read_obj(small(tmp_path, "f 1/1/1 2/2/2 3/3/3\n"))[0].triangles.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"weights": {"b": [[0, 1.0]]}}, "bone 'b' is not listed under bones"),
        ({"weights": {"a": [[9, 1.0]]}}, "a has a weight for vertex 9, but small.obj has 4"),
        ({"weights": {"a": [[0, 1.0]]}}, "vertex 1 has no weight"),
        ({"weights": {"a": [[v, -1.0] for v in range(4)]}}, "vertex 0 has a negative weight"),
        ({"weights": {"a": [[0, "much"]]}}, r"Expected `float`, got `str` - at `\$\.weights"),
        ({"bones": [{"name": "a"}]}, r"missing required field `joint`"),
        ({"bones": [{"name": "a", "joint": [0, 0, 0], "parent": "z"}]}, "bone 'z' is not listed"),
        ({"faces": "f 1 2 9\n"}, "a face uses a vertex that is not there"),
        ({"faces": "f 1 two 3\n"}, "line 5 is not OBJ: 'f 1 two 3'"),
        ({"faces": ""}, "no surface in it, 4 vertices and 0 triangles"),
    ],
)
def test_what_does_not_fit_is_named(tmp_path: Path, change: dict[str, Any], said: str) -> None:
    with pytest.raises(SkinError, match=said) as caught:
        read_obj(small(tmp_path, **change))
    assert "\n" not in str(caught.value)


def test_an_obj_alone_has_no_bones(tmp_path: Path) -> None:
    path = small(tmp_path)
    (tmp_path / "small.weights.json").unlink()
    with pytest.raises(SkinError, match=r"small\.weights\.json: No such file.*an OBJ has no bones"):
        load_avatar(path)
