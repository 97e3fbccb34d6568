"""Profiles on disk: readable TOML, by path, or by name in the user's own folder."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import msgspec
import platformdirs

from arm_ik_service.body.profile import Profile
from arm_ik_service.errors import ProfileError

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")  # a file name anywhere
_MEANING = {
    "stature_m": "what is missing below is derived from this",
    "shoulder_width_m": "between the two glenohumeral joints",
    "hand_m": "wrist to fingertip",
    "position_m": "of the grip, in the OpenXR wrist frame",
}


def profile_folder() -> Path:
    """Where named profiles live; `ARM_IK_PROFILES` in the environment says otherwise."""
    chosen = os.environ.get("ARM_IK_PROFILES")
    return Path(chosen) if chosen else platformdirs.user_config_path("arm_ik_service") / "profiles"


def profile_path(name_or_path: str) -> Path:
    """Path of a profile: a name stands for a file in the user's folder, anything with a dot or a slash for itself."""
    if _NAME.fullmatch(name_or_path):
        return profile_folder() / f"{name_or_path}.toml"
    if not name_or_path or not ({"/", ".", os.sep} & set(name_or_path)):
        raise ProfileError(f"profile {name_or_path!r}: a name has letters, digits, - and _, at most 64 of them")
    return Path(name_or_path)


def profile_names() -> list[str]:
    """Names of the profiles in the user's folder."""
    folder = profile_folder()
    return sorted(path.stem for path in folder.glob("*.toml")) if folder.is_dir() else []


def load_profile(path: Path | None) -> Profile:
    """Read a profile; None gives the person of average stature. Raises ProfileError naming the file and the field."""
    if path is None:
        return Profile()
    try:
        return msgspec.toml.decode(path.read_bytes(), type=Profile)
    except OSError as error:
        raise ProfileError(f"profile {path}: {error.strerror}") from error
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise ProfileError(f"profile {path}: {error}") from error


def find_profile(name_or_path: str | None) -> Profile:
    """Load a profile by name or path; None gives the default. Raises ProfileError, naming the profiles there are."""
    if name_or_path is None:
        return Profile()
    path = profile_path(name_or_path)
    if not path.exists() and _NAME.fullmatch(name_or_path):
        known = ", ".join(profile_names()) or "none yet: `arm-ik calibrate` makes one"
        raise ProfileError(f"no profile named {name_or_path!r} in {path.parent}; there are: {known}")
    return load_profile(path)


def _value(value: Any) -> str:
    if isinstance(value, tuple | list):
        return "[" + ", ".join(_value(v) for v in value) + "]"
    return f"{value:.6g}" if isinstance(value, float) and value != int(value) else repr(value)


def _table(name: str, content: dict[str, Any]) -> list[str]:
    lines, tables = [], []
    for key, value in content.items():
        if isinstance(value, dict):
            tables += _table(f"{name}.{key}", value)
        else:
            comment = f"  # {_MEANING[key]}" if key in _MEANING else ""
            lines.append(f"{key} = {_value(value)}{comment}")
    return ([f"[{name}]", *lines, ""] if lines else []) + tables


def profile_toml(profile: Profile, notes: Iterable[str] = ()) -> str:
    """The profile as TOML that `load_profile` reads back, with `notes` as comments at its head."""
    lines = [f"# {note}" for note in notes]
    content: dict[str, Any] = msgspec.to_builtins(profile)
    content["body"]["stature_m"] = profile.body.stature_m  # said even where it is the default
    for name, table in content.items():
        lines += _table(name, table)
    return "\n".join(lines).rstrip() + "\n"


def save_profile(profile: Profile, path: Path, notes: Iterable[str] = ()) -> None:
    """Write a profile, whole or not at all. Raises ProfileError naming the file."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        draft = path.with_suffix(".toml.part")
        draft.write_text(profile_toml(profile, notes), encoding="utf-8")
        draft.replace(path)
    except OSError as error:
        raise ProfileError(f"profile {path}: {error.strerror}") from error
