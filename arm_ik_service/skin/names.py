"""Which bone of a stranger's skeleton is which: by VRM's humanoid map where there is one, else by common names.

Roles are VRM 1.0's humanoid bone names. Understood besides: Unity, Mixamo and Ready Player Me (`LeftForeArm`), Unreal
and MakeHuman's game engine rig (`lowerarm_l`), Blender's Rigify (`forearm.L`), 3ds Max Biped (`Bip001 L Forearm`),
VRoid (`J_Bip_L_LowerArm`), Character Creator (`CC_Base_L_Forearm`), Daz (`lForearmBend`).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from arm_ik_service.errors import SkinError
from arm_ik_service.wire.messages import SIDES

_SPINE = {
    "hips": ("hips", "hip", "pelvis"),
    "neck": ("neck", "neck1", "necklower", "necktwist1"),
    "head": ("head",),
}
_ARM = {
    "Shoulder": ("clavicle", "shoulder", "collar"),
    "UpperArm": ("upperarm", "arm", "uparm", "shldr", "shldrbend"),
    "LowerArm": ("lowerarm", "forearm", "forearmbend", "elbow", "loarm"),
    "Hand": ("hand", "wrist"),
    "ThumbMetacarpal": ("thumb1", "handthumb1", "thumbmetacarpal", "finger0"),
    "IndexProximal": ("index1", "handindex1", "indexproximal", "finger1"),
    "MiddleProximal": ("middle1", "mid1", "handmiddle1", "middleproximal", "finger2"),
    "LittleProximal": ("little1", "pinky1", "handpinky1", "littleproximal", "pinkyproximal", "finger4"),
}
_PREFIXES = {"mixamorig", "bip", "j", "c", "def", "cc", "base", "valve", "biped", "armature", "f", "b", "bone", "rig"}
_SIDES = {"left": "left", "l": "left", "right": "right", "r": "right"}
_REQUIRED = tuple(f"{side}{part}" for side in SIDES for part in ("UpperArm", "LowerArm", "Hand"))

_ROLES = {name: role for role, names in _SPINE.items() for name in names} | {
    side + name: side + part for side in SIDES for part, names in _ARM.items() for name in names
}


def find_roles(names: Sequence[str], declared: Mapping[str, int] | None = None) -> dict[str, int]:
    """Return role -> bone for the bones `names` (B,); `declared` is the file's own map and wins.

    Raises SkinError where an upper arm, lower arm or hand is missing.
    """
    roles = dict(declared or {})
    if not all(role in roles for role in _REQUIRED):
        for bone, name in enumerate(names):
            role = role_of(name)
            if role is not None:
                roles.setdefault(role, bone)
    missing = [role for role in _REQUIRED if role not in roles]
    if missing:
        some = ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")
        raise SkinError(
            f"no bone found for {', '.join(missing)} among {len(names)} ({some}): "
            "bones are known by VRM's humanoid map or by names as of Mixamo, Unreal, Rigify or Biped"
        )
    return roles


def role_of(name: str) -> str | None:
    """Return the role that a bone's name tells, if it does."""
    words = [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name)]
    side = ""
    rest: list[str] = []
    for word in words:
        if word in _SIDES and not side:
            side = _SIDES[word]
        elif word.isdigit():
            if rest:  # a number before the name is the rig's own: Bip001
                rest.append(word.lstrip("0") or "0")
        elif word not in _PREFIXES or rest:
            rest.append(word)
    return _ROLES.get(side + "".join(rest))
