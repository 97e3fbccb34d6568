"""A skinned character in place of solids: what bends is sent vertex by vertex, what is rigid only moved.

A humanoid of 13 000 vertices has 3 600 that bend: 90 kB a frame. The hands, two thirds of the arms that we ship, and
head and legs are logged once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import rerun as rr

from arm_ik_service.geometry import batch
from arm_ik_service.io.rerun_view.palette import SIDE_COLOURS
from arm_ik_service.io.rerun_view.rows import BONES, PLACES, Floats
from arm_ik_service.io.rerun_view.timelines import Integers, time_columns
from arm_ik_service.skin.blend import Skinning
from arm_ik_service.skin.character import PARTS, Character
from arm_ik_service.skin.fit import ArmMeasures
from arm_ik_service.skin.mesh import SkinnedMesh
from arm_ik_service.skin.puppet import Puppet
from arm_ik_service.skin.twist import along
from arm_ik_service.wire.messages import SIDES, Skeleton

PIECE = 64  # frames skinned and sent together: 6 MB
FITS_WITHIN = 0.015  # of the arm's length, 8 mm: nobody sees that at a wrist
SLEEVE_ENDS = 0.88  # of the forearm, where arms alone wear sleeves
WHITE = 255  # a hand to be tinted by its tracking state


@dataclass(frozen=True)
class Skin:
    """The character that avatars are drawn as."""

    character: Character
    skinning: Skinning = "dual_quaternion"

    @property
    def arms_only(self) -> bool:
        """Whether trunk and head stay solids; sleeves and tinted hands then say what those of solids say."""
        return "head" not in self.character.has

    @property
    def replaces(self) -> set[str]:
        """Names of the solids that are not drawn beside it."""
        names = {f"{side}/{bone}" for side in SIDES for bone in BONES}
        names |= {part for part in ("head", "neck") if part in self.character.has}
        names |= {"chest"} if "hips" in self.character.has else set()
        return names | {f"{side}/shoulder" for side in SIDES if f"{side}Shoulder" in self.character.has}


class SkinSender:
    """Draws one avatar as a character, below the entity `root`."""

    def __init__(self, recording: rr.RecordingStream, root: str, skin: Skin) -> None:
        self._recording = recording
        self._root = root
        self._skin = skin
        self._puppet: Puppet | None = None
        self._measures: ArmMeasures | None = None
        self._rigid: list[int] = []

    def describe(self, skeleton: Skeleton) -> None:
        """Fit the character to a person and log its rigid parts and the triangles of the rest, static."""
        self._fit(ArmMeasures(skeleton.stature_m, skeleton.upper_arm_m, skeleton.forearm_m, skeleton.shoulder_width_m))

    def _fit(self, measures: ArmMeasures) -> None:
        self._measures = measures
        puppet = Puppet(self._skin.character, measures, self._skin.skinning)
        if self._skin.arms_only:
            puppet.mesh = replace(puppet.mesh, colours=_sleeves(puppet.mesh))
        carriers, bending = _divided(puppet.mesh)
        self._rigid = sorted(carriers)
        for bone, triangles in carriers.items():
            part = _part(puppet.mesh, triangles)
            if (entity := self._tinted_hand(bone)) is not None:
                part = replace(_in_hand_frame(part, puppet, bone), colours=np.full_like(part.colours, WHITE))
            self._log(entity or f"skin/{PARTS[bone]}", part, static_vertices=True)
        puppet.mesh = _part(puppet.mesh, bending)
        self._log("skin/bending", puppet.mesh, static_vertices=False)
        self._puppet = puppet

    def send(self, values: Floats, frames: Integers, times_ns: Integers) -> None:
        """Send the gathered rows of `values` (N, WIDTH) under their times (N,)."""
        for start in range(0, len(values), PIECE):
            piece = slice(start, start + PIECE)
            self._send(values[piece], time_columns(frames[piece], times_ns[piece]))

    def _send(self, values: Floats, time: list[rr.TimeColumn]) -> None:
        self._follow_lengths(values[-1])
        assert self._puppet is not None
        rows = len(values)
        names = ["chest", "head", *(f"{side}/{bone}" for side in SIDES for bone in BONES)]
        motions = self._puppet.motions({name: values[:, PLACES[name]] for name in names})
        for bone in self._rigid:
            if self._tinted_hand(bone) is None:  # that one is moved as the solid would be
                motion = motions[:, bone]
                self._recording.send_columns(
                    f"{self._root}/skin/{PARTS[bone]}",
                    time,
                    rr.Transform3D.columns(translation=motion[:, :3], quaternion=motion[:, 3:]),
                )
        count = len(self._puppet.mesh.vertices)
        vertices = np.empty((rows, count, 3), np.float32)
        normals = np.empty((rows, count, 3), np.float32)
        for row in range(rows):
            vertices[row], normals[row] = self._puppet.skin(motions[row])
        self._recording.send_columns(
            f"{self._root}/skin/bending",
            time,
            rr.Mesh3D.columns(
                vertex_positions=vertices.reshape(-1, 3), vertex_normals=normals.reshape(-1, 3)
            ).partition([count] * rows),
        )

    def _follow_lengths(self, row: Floats) -> None:
        """Fit the character again where the arms have grown since: those of people without a profile are learnt."""
        assert self._measures is not None
        joints = [[row[PLACES[f"{side}/{bone}"]][:3] for side in SIDES] for bone in BONES]
        shoulders, elbows, wrists = np.array(joints)
        upper_arm, forearm = np.linalg.norm(shoulders - elbows, axis=1), np.linalg.norm(elbows - wrists, axis=1)
        now = replace(self._measures, upper_arm=float(upper_arm.mean()), forearm=float(forearm.mean()))
        grown = (now.upper_arm + now.forearm) / (self._measures.upper_arm + self._measures.forearm)
        if abs(grown - 1.0) > FITS_WITHIN:
            self._fit(now)

    def _tinted_hand(self, bone: int) -> str | None:
        """Entity of the solid hand that this part stands in for, if it does."""
        for side in SIDES:
            if self._skin.arms_only and PARTS[bone] == f"{side}Hand":
                return f"{side}/hand"
        return None

    def _log(self, entity: str, mesh: SkinnedMesh, *, static_vertices: bool) -> None:
        surface = rr.Mesh3D.from_fields(
            triangle_indices=mesh.triangles,
            vertex_colors=mesh.colours,
            vertex_positions=mesh.vertices.astype(np.float32) if static_vertices else None,
            vertex_normals=mesh.normals.astype(np.float32) if static_vertices else None,
        )
        self._recording.log(f"{self._root}/{entity}", surface, static=True)


def _divided(mesh: SkinnedMesh) -> tuple[dict[int, npt.NDArray[np.uint32]], npt.NDArray[np.uint32]]:
    """Triangles (T,3) that one part carries alone, by that part, and all others."""
    whole = np.where((mesh.weights[:, 0] > 1.0 - 1e-9) & (mesh.bones[:, 0] < len(PARTS)), mesh.bones[:, 0], -1)
    carrier = whole[mesh.triangles]
    alone = (carrier[:, 0] >= 0) & (carrier == carrier[:, :1]).all(axis=1)
    carriers = {int(bone): mesh.triangles[alone & (carrier[:, 0] == bone)] for bone in np.unique(carrier[alone])}
    return carriers, mesh.triangles[~alone]


def _part(mesh: SkinnedMesh, triangles: npt.NDArray[np.uint32]) -> SkinnedMesh:
    """The mesh of these triangles alone."""
    kept, places = np.unique(triangles, return_inverse=True)
    return replace(
        mesh,
        vertices=mesh.vertices[kept],
        normals=mesh.normals[kept],
        colours=mesh.colours[kept],
        bones=mesh.bones[kept],
        weights=mesh.weights[kept],
        triangles=places.reshape(-1, 3).astype(np.uint32),
    )


def _in_hand_frame(mesh: SkinnedMesh, puppet: Puppet, bone: int) -> SkinnedMesh:
    side = SIDES[0] if PARTS[bone].startswith(SIDES[0]) else SIDES[1]
    hand = puppet.arms[side]
    back = batch.inverse(np.concatenate([hand.wrist, hand.hand]))
    return replace(
        mesh,
        vertices=back[:3] + batch.rotate(back[3:], mesh.vertices),
        normals=batch.rotate(back[3:], mesh.normals),
    )


def _sleeves(mesh: SkinnedMesh) -> npt.NDArray[np.uint8]:
    """Sleeves in the colours of the sides, and the skin's own colour beyond them."""
    colours = mesh.colours.copy()
    for side in SIDES:
        parts = [PARTS.index(f"{side}{part}") for part in ("LowerArm", "Hand")]
        mine = (mesh.vertices[:, 0] > 0.0) == (side == "right")
        elbow, wrist = mesh.joints[parts]
        colours[mine & (along(mesh.vertices, elbow, wrist) < SLEEVE_ENDS)] = SIDE_COLOURS[side]
    return colours
