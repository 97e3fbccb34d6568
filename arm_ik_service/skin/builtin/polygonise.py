"""From a solid to triangles: rings around a limb, naive surface nets (Gibson 1998) for a hand, a seam between."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from arm_ik_service.skin.mesh import Floats, Integers

Distance = Callable[[Floats], Floats]


def rings(distance: Distance, centres: Floats, widest: float, around: int) -> tuple[Floats, Integers]:
    """Vertices (R * around, 3) and triangles of a tube of level rings around `centres` (R,3), from above; open ends.

    The surface is looked for on rays from the centres, up to `widest` [m] away.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    ray = np.stack([np.cos(angle), np.zeros(around), np.sin(angle)], axis=-1)
    near, far = np.zeros((len(centres), around, 1)), np.full((len(centres), around, 1), widest)
    for _ in range(30):
        middle = 0.5 * (near + far)
        inside = distance(centres[:, None] + middle * ray)[..., None] < 0.0
        near, far = np.where(inside, middle, near), np.where(inside, far, middle)
    vertices = centres[:, None] + far * ray
    corner = np.arange(len(centres) * around).reshape(-1, around)
    a, b = corner[:-1], corner[1:]
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    triangles = np.concatenate([np.stack([a, c, b], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)])
    return vertices.reshape(-1, 3), triangles


def surface_net(distance: Distance, lower: Floats, upper: Floats, step: float) -> tuple[Floats, Integers]:
    """Vertices (V,3) and triangles (T,3) of the surface within a box; open where the box cuts it."""
    axes = [np.arange(low, high + 0.5 * step, step) for low, high in zip(lower, upper, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    values = distance(grid)
    inside = values < 0.0

    corners = [np.array([i, j, k]) for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    cells = tuple(n - 1 for n in inside.shape)

    def corner(array: npt.NDArray[Any], at: Integers) -> npt.NDArray[Any]:
        return array[tuple(slice(o, o + n) for o, n in zip(at, cells, strict=True))]

    count = sum(corner(inside, at).astype(np.int64) for at in corners)
    crossed = (count > 0) & (count < 8)
    index = np.full(cells, -1, np.int64)
    index[crossed] = np.arange(np.count_nonzero(crossed))
    total, hits = np.zeros((np.count_nonzero(crossed), 3)), np.zeros(np.count_nonzero(crossed))
    for a in corners:
        for axis in range(3):
            if a[axis]:
                continue
            b = a.copy()
            b[axis] = 1
            va, vb = corner(values, a)[crossed], corner(values, b)[crossed]
            cut = (va < 0.0) != (vb < 0.0)
            pa, pb = (grid[tuple(slice(o, o + n) for o, n in zip(at, cells, strict=True))][crossed] for at in (a, b))
            part = np.where(cut, va / np.where(cut, va - vb, 1.0), 0.0)[:, None]
            total += np.where(cut[:, None], pa + part * (pb - pa), 0.0)
            hits += cut
    vertices = _onto(distance, total / hits[:, None], step)

    triangles = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        here = [slice(None)] * 3
        there = [slice(None)] * 3
        here[axis], there[axis] = slice(0, -1), slice(1, None)
        for leaving in (True, False):
            first, second = inside[tuple(here)], inside[tuple(there)]
            edges = np.argwhere((first & ~second) if leaving else (~first & second))
            edges = edges[(edges[:, u] > 0) & (edges[:, v] > 0) & (edges[:, u] < cells[u]) & (edges[:, v] < cells[v])]
            quad = []
            for du, dv in ((1, 1), (0, 1), (0, 0), (1, 0)):
                cell = edges.copy()
                cell[:, u] -= du
                cell[:, v] -= dv
                quad.append(index[tuple(cell.T)])
            p, q, r, s = quad if leaving else quad[::-1]
            triangles += [np.stack([p, q, r], -1), np.stack([p, r, s], -1)]
    return vertices, np.concatenate(triangles)


def _onto(distance: Distance, points: Floats, step: float) -> Floats:
    """Draw points onto the surface, by no more than a cell."""
    start = points
    for _ in range(3):
        normal = gradient(distance, points)
        points = points - np.clip(distance(points), -0.3 * step, 0.3 * step)[:, None] * normal
    moved = points - start
    length = np.linalg.norm(moved, axis=1, keepdims=True)
    return np.asarray(start + moved * np.minimum(1.0, 0.6 * step / np.maximum(length, 1e-12)))


def gradient(distance: Distance, points: Floats, step: float = 2e-4) -> Floats:
    """Unit gradient (V,3): the outward normal on the surface."""
    slopes = [distance(points + step * e) - distance(points - step * e) for e in np.eye(3)]
    g = np.stack(slopes, axis=-1)
    return np.asarray(g / np.maximum(np.linalg.norm(g, axis=-1, keepdims=True), 1e-12))


def open_edge(vertices: Floats, triangles: Integers) -> Integers:
    """The vertices along the one open edge of a surface, in order of their angle about y from their middle."""
    edges = np.concatenate([triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    sides, times = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    rim = np.unique(sides[times == 1])
    off = vertices[rim] - vertices[rim].mean(axis=0)
    return np.asarray(rim[np.argsort(np.arctan2(off[:, 2], off[:, 0]))])


def zip_up(vertices: Floats, upper: Integers, lower: Integers) -> Integers:
    """Triangles between two rims, both in the order of growing angle about y; the outside is away from y."""
    middle = vertices[upper].mean(axis=0)

    def angles(rim: Integers) -> Floats:
        off = vertices[rim] - middle
        return np.asarray(np.arctan2(off[:, 2], off[:, 0]))

    nearest = np.argmin(np.abs(np.exp(1j * angles(lower)) - np.exp(1j * angles(upper)[0])))
    lower = np.roll(lower, -nearest)
    a, b = np.unwrap(angles(upper)), np.unwrap(angles(lower))
    b += 2.0 * np.pi * np.round((a[0] - b[0]) / (2.0 * np.pi))
    i = j = 0
    made = []
    while i < len(upper) or j < len(lower):
        next_a = a[(i + 1) % len(upper)] + 2.0 * np.pi * ((i + 1) // len(upper))
        next_b = b[(j + 1) % len(lower)] + 2.0 * np.pi * ((j + 1) // len(lower))
        here = upper[i % len(upper)], lower[j % len(lower)]
        if j == len(lower) or (i < len(upper) and next_a <= next_b):
            made.append((here[0], upper[(i + 1) % len(upper)], here[1]))
            i += 1
        else:
            made.append((here[0], lower[(j + 1) % len(lower)], here[1]))
            j += 1
    return np.array(made, np.int64)
