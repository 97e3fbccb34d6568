"""Triangle meshes of the figure's parts: tubes with smooth outlines, capsules, rounded boxes. Metres; no Rerun here.

A part is built once, in the axes of the bone that carries it, and then only moved.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Colour = tuple[int, int, int]

AROUND = 28  # corners of a ring: round to the eye at the size of an arm
_SMOOTHING = 3  # rounds of corner cutting: a ring every 1 to 2 cm of an arm


@dataclass(frozen=True)
class Solid:
    """A closed surface: `vertices` (V,3) [m], unit `normals` (V,3), `triangles` (T,3), `colours` (V,3) 0..255."""

    vertices: Floats
    normals: Floats
    triangles: npt.NDArray[np.uint32]
    colours: npt.NDArray[np.uint8]

    def mirrored(self, axis: int) -> Solid:
        """Reflect in the plane through the origin across `axis`; the triangles keep their outside outside."""
        sign = np.ones(3)
        sign[axis] = -1.0
        return Solid(self.vertices * sign, self.normals * sign, self.triangles[:, ::-1].copy(), self.colours)

    def scaled(self, factor: float) -> Solid:
        """Enlarge about the origin."""
        return Solid(self.vertices * factor, self.normals, self.triangles, self.colours)

    def moved(self, offset: npt.ArrayLike) -> Solid:
        """Shift by `offset` (3) [m]."""
        return Solid(self.vertices + np.asarray(offset, float), self.normals, self.triangles, self.colours)


def join(*solids: Solid) -> Solid:
    """One mesh of several."""
    starts = np.cumsum([0, *(len(s.vertices) for s in solids[:-1])])
    return Solid(
        np.concatenate([s.vertices for s in solids]),
        np.concatenate([s.normals for s in solids]),
        np.concatenate([s.triangles + np.uint32(start) for s, start in zip(solids, starts, strict=True)]),
        np.concatenate([s.colours for s in solids]),
    )


def _smooth(outline: Floats) -> Floats:
    """Cut the corners of an open outline (N, k) (Chaikin 1974); its ends stay."""
    for _ in range(_SMOOTHING):
        a, b = outline[:-1], outline[1:]
        cut = np.stack([0.75 * a + 0.25 * b, 0.25 * a + 0.75 * b], axis=1).reshape(-1, outline.shape[1])
        outline = np.concatenate([outline[:1], cut, outline[-1:]])
    return outline


def _skin(rings: Floats, colour: Colour) -> Solid:
    """Surface over rings (R, AROUND, 3) that run around +Y; the outermost rings are small enough to be the ends."""
    count, around = rings.shape[:2]
    corner = np.arange(count * around, dtype=np.uint32).reshape(count, around)
    a, b = corner[:-1], corner[1:]
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    triangles = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    vertices = rings.reshape(-1, 3)
    normals = np.zeros_like(vertices)
    faces = np.cross(
        vertices[triangles[:, 1]] - vertices[triangles[:, 0]], vertices[triangles[:, 2]] - vertices[triangles[:, 0]]
    )
    for k in range(3):
        np.add.at(normals, triangles[:, k], faces)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return Solid(vertices, normals, triangles, np.tile(np.array(colour, np.uint8), (len(vertices), 1)))


def tube(sections: npt.ArrayLike, colour: Colour, *, squareness: float = 2.0) -> Solid:
    """A lofted tube along Y from `sections` (N,5): y, half width in x, half width in z, centre x, centre z [m].

    `sections` run downwards in y. The ends are drawn in to points. `squareness` 2 gives ellipses, more gives
    rounded rectangles.
    """
    given = np.asarray(sections, float)
    ends = given[[0, -1]].copy()
    ends[:, 1:3] = 1e-4
    outline = _smooth(np.concatenate([ends[:1], given, ends[1:]]))
    angle = np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False)
    x, z = (np.sign(f) * np.abs(f) ** (2.0 / squareness) for f in (np.cos(angle), np.sin(angle)))
    rings = np.empty((len(outline), AROUND, 3))
    rings[..., 0] = outline[:, 3:4] + outline[:, 1:2] * x
    rings[..., 1] = outline[:, 0:1]
    rings[..., 2] = outline[:, 4:5] + outline[:, 2:3] * z
    return _skin(rings[:, ::-1], colour)


def _across(direction: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors that make a right-handed frame (u, direction, w)."""
    helper = np.array([1.0, 0.0, 0.0]) if abs(direction[0]) < 0.9 else np.array([0.0, 0.0, 1.0])
    w = np.cross(helper, direction)
    w /= np.linalg.norm(w)
    return np.cross(direction, w), w


def capsule(start: npt.ArrayLike, end: npt.ArrayLike, radii: tuple[float, float], colour: Colour) -> Solid:
    """A capsule between two points [m], tapered from the first radius to the second."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    axis = (a - b) / np.linalg.norm(a - b)
    u, w = _across(axis)
    up = np.linspace(0.5 * np.pi, 0.0, 6)
    caps = [
        (point, radius, sign * lift) for point, radius, sign in ((a, radii[0], 1), (b, radii[1], -1)) for lift in up
    ]
    caps[6:] = caps[:5:-1]
    angle = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)[:, None]
    rings = [
        point
        + axis * radius * np.sin(lift)
        + radius * max(np.cos(lift), 1e-3) * (np.cos(angle) * u + np.sin(angle) * w)
        for point, radius, lift in caps
    ]
    return _skin(np.stack(rings)[:, ::-1], colour)


def rounded_box(half: npt.ArrayLike, colour: Colour, *, roundness: float = 0.5) -> Solid:
    """A superellipsoid of half sizes (3) [m]: `roundness` 1 is an ellipsoid, towards 0 a box (Barr 1981)."""
    lift = np.linspace(0.5 * np.pi, -0.5 * np.pi, 19)[:, None]
    angle = np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False)[None, :]

    def power(value: Any) -> Any:
        return np.sign(value) * np.abs(value) ** roundness

    flat = np.maximum(power(np.cos(lift)), 1e-3)
    unit = np.stack(
        [flat * power(np.cos(angle)), power(np.sin(lift)) * np.ones_like(angle), flat * power(np.sin(angle))], -1
    )
    return _skin((unit * np.asarray(half, float))[:, ::-1], colour)


def ring(radius: float, thickness: float, colour: Colour) -> Solid:
    """A torus about Z [m]."""
    around = np.linspace(0.0, 2.0 * np.pi, 33)[:, None]
    angle = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)[None, :]
    out = radius + thickness * np.cos(angle)
    rings = np.stack([out * np.cos(around), out * np.sin(around), thickness * np.sin(angle) * np.ones_like(around)], -1)
    return _skin(rings[:, ::-1], colour)
