"""Both skinnings against textbook forms of them, written as slowly and plainly as they are printed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from arm_ik_service.geometry import batch
from arm_ik_service.skin.blend import Skinning, skin
from arm_ik_service.skin.mesh import Floats, SkinnedMesh, pack_weights

BOTH: list[Skinning] = ["linear", "dual_quaternion"]
STILL = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


def some_mesh(seed: int, vertices: int = 60, bones: int = 7, influences: int = 4) -> SkinnedMesh:
    rng = np.random.default_rng(seed)
    indices, weights = pack_weights(
        rng.integers(0, bones, (vertices, influences)), rng.uniform(0.0, 1.0, (vertices, influences)), bones
    )
    return SkinnedMesh(
        vertices=rng.normal(size=(vertices, 3)),
        normals=batch.normalized(rng.normal(size=(vertices, 3))),
        triangles=np.zeros((0, 3), np.uint32),
        colours=np.zeros((vertices, 3), np.uint8),
        names=tuple(f"bone {b}" for b in range(bones)),
        parents=(-1,) * bones,
        joints=np.zeros((bones, 3)),
        bones=indices,
        weights=weights,
    )


def some_motions(seed: int, bones: int = 7) -> Floats:
    rng = np.random.default_rng(seed)
    rotations = batch.normalized(rng.normal(size=(bones, 4)))
    return np.concatenate([rng.normal(size=(bones, 3)), rotations], axis=1)


def homogeneous(motion: Floats) -> Floats:
    m = np.eye(4)
    m[:3, :3], m[:3, 3] = batch.matrix(motion[3:]), motion[:3]
    return m


def textbook_linear(mesh: SkinnedMesh, motions: Floats) -> tuple[Floats, Floats]:
    vertices, normals = [], []
    for v in range(len(mesh.vertices)):
        blended = np.zeros((4, 4))
        for bone, weight in zip(mesh.bones[v], mesh.weights[v], strict=True):
            blended += weight * homogeneous(motions[bone])
        vertices.append((blended @ [*mesh.vertices[v], 1.0])[:3])
        normals.append(batch.normalized(blended[:3, :3] @ mesh.normals[v]))
    return np.array(vertices), np.array(normals)


def textbook_dual_quaternion(mesh: SkinnedMesh, motions: Floats) -> tuple[Floats, Floats]:
    """Kavan et al. 2008: blend, divide by the norm of the real part, turn into a matrix."""
    vertices, normals = [], []
    for v in range(len(mesh.vertices)):
        real, dual = np.zeros(4), np.zeros(4)
        first = motions[mesh.bones[v, 0], 3:]
        for bone, weight in zip(mesh.bones[v], mesh.weights[v], strict=True):
            q = motions[bone, 3:]
            sign = 1.0 if first @ q >= 0.0 else -1.0
            real += weight * sign * q
            dual += weight * sign * 0.5 * batch.multiply([*motions[bone, :3], 0.0], q)
        norm = np.linalg.norm(real)
        real, dual = real / norm, dual / norm
        translation = 2.0 * batch.multiply(dual, batch.conjugate(real))[:3]
        rotation = batch.matrix(real)
        vertices.append(rotation @ mesh.vertices[v] + translation)
        normals.append(rotation @ mesh.normals[v])
    return np.array(vertices), np.array(normals)


TEXTBOOK: dict[Skinning, Callable[[SkinnedMesh, Floats], tuple[Floats, Floats]]] = {
    "linear": textbook_linear,
    "dual_quaternion": textbook_dual_quaternion,
}


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("how", "textbook"), [*TEXTBOOK.items()])
def test_every_vertex_and_normal_is_that_of_the_textbook(
    how: Skinning, textbook: Callable[[SkinnedMesh, Floats], tuple[Floats, Floats]], seed: int
) -> None:
    mesh, motions = some_mesh(seed, influences=1 + seed), some_motions(100 + seed)
    for ours, theirs in zip(skin(mesh, motions, how), textbook(mesh, motions), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("how", BOTH)
def test_no_motion_returns_the_mesh_to_the_last_bit(how: Skinning) -> None:
    mesh = some_mesh(1)
    vertices, normals = skin(mesh, np.tile(STILL, (7, 1)), how)
    np.testing.assert_array_equal(vertices, mesh.vertices)
    np.testing.assert_allclose(normals, mesh.normals, rtol=0.0, atol=3e-16)


@pytest.mark.parametrize("how", BOTH)
def test_bones_that_move_as_one_move_the_mesh_as_a_rigid_body(how: Skinning) -> None:
    mesh, motion = some_mesh(2), some_motions(3, 1)[0]
    vertices, normals = skin(mesh, np.tile(motion, (7, 1)), how)
    np.testing.assert_allclose(vertices, batch.rotate(motion[3:], mesh.vertices) + motion[:3], rtol=0.0, atol=4e-15)
    np.testing.assert_allclose(normals, batch.rotate(motion[3:], mesh.normals), rtol=0.0, atol=2e-15)


def test_a_quaternion_and_its_negative_are_the_same_motion() -> None:
    mesh, motions = some_mesh(4), some_motions(5)
    flipped = motions.copy()
    flipped[::2, 3:] *= -1.0
    for how in BOTH:
        np.testing.assert_allclose(skin(mesh, flipped, how)[0], skin(mesh, motions, how)[0], rtol=0.0, atol=1e-14)


def test_the_order_of_equally_heavy_bones_hardly_matters() -> None:
    """Halves of two bones, in either order: the blend is the motion half-way."""
    mesh, motions = some_mesh(6, influences=2), some_motions(7)
    mesh = replace(mesh, bones=np.tile([0, 1], (60, 1)), weights=np.full((60, 2), 0.5))
    turned = replace(mesh, bones=mesh.bones[:, ::-1].copy())
    np.testing.assert_allclose(skin(mesh, motions)[0], skin(turned, motions)[0], rtol=0.0, atol=1e-13)


def test_motions_of_another_skeleton_are_refused() -> None:
    with pytest.raises(ValueError, match=r"\(3, 7\).*7 bones"):
        skin(some_mesh(0), np.zeros((3, 7)))


def test_results_are_written_where_the_caller_says() -> None:
    mesh, motions = some_mesh(0), some_motions(0)
    out = (np.empty_like(mesh.vertices), np.empty_like(mesh.normals))
    returned = skin(mesh, motions, out=out)
    assert returned[0] is out[0]
    np.testing.assert_array_equal(out[0], skin(mesh, motions)[0])
