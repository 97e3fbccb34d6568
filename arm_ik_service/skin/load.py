"""An avatar file to a character, whatever its format."""

from __future__ import annotations

from pathlib import Path

from arm_ik_service.errors import SkinError
from arm_ik_service.skin.character import Character, character_of
from arm_ik_service.skin.names import find_roles

GLTF = {".glb", ".gltf", ".vrm"}


def load_avatar(path: Path) -> Character:
    """Read a glTF, GLB, VRM or OBJ humanoid. Raises SkinError, one line that names the file and what is wrong."""
    suffix = path.suffix.lower()
    if suffix in GLTF:
        from arm_ik_service.skin.gltf import read_gltf

        mesh, declared = read_gltf(path)
    elif suffix == ".obj":
        from arm_ik_service.skin.obj import read_obj

        mesh, declared = read_obj(path)
    else:
        raise SkinError(f"{path}: avatars are .glb, .gltf, .vrm or .obj files")
    try:
        return character_of(mesh, find_roles(mesh.names, declared))
    except SkinError as error:
        raise SkinError(f"{path}: {error}") from error


def load_built_in_arms() -> Character:
    """Return the arms that we ship."""
    from arm_ik_service.skin.builtin import built_in_arms

    mesh = built_in_arms()
    return character_of(mesh, find_roles(mesh.names))
