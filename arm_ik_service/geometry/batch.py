"""Rotations and poses as numpy functions over any leading shape: quaternions (..., 4) x y z w, poses (..., 7)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def multiply(a: npt.ArrayLike, b: npt.ArrayLike) -> Array:
    """Hamilton product (..., 4): first b, then a."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    av, aw, bv, bw = a[..., :3], a[..., 3:], b[..., :3], b[..., 3:]
    xyz = aw * bv + bw * av + np.cross(av, bv)
    return np.asarray(np.concatenate([xyz, aw * bw - np.sum(av * bv, axis=-1, keepdims=True)], axis=-1))


def conjugate(q: npt.ArrayLike) -> Array:
    """Inverse (..., 4) of unit quaternions."""
    return np.asarray(np.asarray(q, float) * np.array([-1.0, -1.0, -1.0, 1.0]))


def normalized(q: npt.ArrayLike) -> Array:
    """Scale (..., n) to unit length along the last axis."""
    q = np.asarray(q, float)
    return np.asarray(q / np.linalg.norm(q, axis=-1, keepdims=True))


def rotate(q: npt.ArrayLike, v: npt.ArrayLike) -> Array:
    """Turn vectors (..., 3) by unit quaternions (..., 4)."""
    q, v = np.asarray(q, float), np.asarray(v, float)
    xyz = np.broadcast_to(q[..., :3], np.broadcast_shapes(q[..., :3].shape, v.shape))
    t = 2.0 * np.cross(xyz, v)
    return np.asarray(v + q[..., 3:] * t + np.cross(xyz, t))


def exp(w: npt.ArrayLike) -> Array:
    """Rotation vectors (..., 3) [rad] to unit quaternions (..., 4)."""
    w = np.asarray(w, float)
    angle = np.linalg.norm(w, axis=-1, keepdims=True)
    return np.concatenate([0.5 * np.sinc(angle / (2.0 * np.pi)) * w, np.cos(0.5 * angle)], axis=-1)


def log(q: npt.ArrayLike) -> Array:
    """Unit quaternions (..., 4) to shortest rotation vectors (..., 3) [rad]."""
    q = np.asarray(q, float)
    q = np.where(q[..., 3:] < 0.0, -q, q)
    n = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    s = np.where(n < 1e-12, 2.0, 2.0 * np.arctan2(n, q[..., 3:]) / np.maximum(n, 1e-300))
    return np.asarray(s * q[..., :3])


def matrix(q: npt.ArrayLike) -> Array:
    """Unit quaternions (..., 4) to rotation matrices (..., 3, 3)."""
    x, y, z, w = np.moveaxis(np.asarray(q, float), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def from_matrix(m: npt.ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) to unit quaternions (..., 4) with w >= 0 (Bar-Itzhack 2000)."""
    m = np.asarray(m, float)
    k = np.empty((*m.shape[:-2], 4, 4))
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    k[..., 0, 0], k[..., 1, 1], k[..., 2, 2], k[..., 3, 3] = xx - yy - zz, yy - xx - zz, zz - xx - yy, xx + yy + zz
    for i, j in ((0, 1), (0, 2), (1, 2)):
        k[..., i, j] = k[..., j, i] = m[..., i, j] + m[..., j, i]
    for i, (j, n) in enumerate(((2, 1), (0, 2), (1, 0))):
        k[..., i, 3] = k[..., 3, i] = m[..., j, n] - m[..., n, j]
    q = np.linalg.eigh(k)[1][..., :, -1]
    return np.asarray(np.where(q[..., 3:] < 0.0, -q, q))


def compose(a_from_b: npt.ArrayLike, b_from_c: npt.ArrayLike) -> Array:
    """Chain poses (..., 7): a_from_c."""
    p, q = np.asarray(a_from_b, float), np.asarray(b_from_c, float)
    position = p[..., :3] + rotate(p[..., 3:], q[..., :3])
    rotation = multiply(p[..., 3:], q[..., 3:])
    return np.concatenate([position, rotation], axis=-1)


def inverse(a_from_b: npt.ArrayLike) -> Array:
    """Invert poses (..., 7): b_from_a."""
    p = np.asarray(a_from_b, float)
    rotation = conjugate(p[..., 3:])
    return np.asarray(np.concatenate([-rotate(rotation, p[..., :3]), rotation], axis=-1))


def mirror_pose(pose: npt.ArrayLike) -> Array:
    """Reflect poses (..., 7) in the sagittal plane x = 0."""
    return np.asarray(np.asarray(pose, float) * np.array([-1.0, 1.0, 1.0, 1.0, -1.0, -1.0, 1.0]))


def angle_between(a: npt.ArrayLike, b: npt.ArrayLike) -> Array:
    """Angle [rad] (...,) of the rotation from a to b."""
    return np.asarray(np.linalg.norm(log(multiply(conjugate(a), b)), axis=-1))
