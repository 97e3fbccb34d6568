"""Whether an OpenXR runtime is installed, by the rules of the OpenXR loader (its document, "Runtime Discovery")."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from pathlib import Path

HOW_TO_GET_ONE = (
    "no OpenXR runtime is installed: install Monado (apt-get install monado-service) or SteamVR and make it the active "
    "one, or set XR_RUNTIME_JSON to its manifest; a standalone headset needs none: arm-ik bridge web"
)


def manifest_paths(environment: Mapping[str, str]) -> list[Path]:
    """Return the places where the loader looks for the active runtime's manifest on Linux, in its order."""
    if named := environment.get("XR_RUNTIME_JSON"):
        return [Path(named)]
    home = Path(environment.get("HOME", "/"))
    folders = [Path(environment.get("XDG_CONFIG_HOME") or home / ".config")]
    folders += [Path(folder) for folder in (environment.get("XDG_CONFIG_DIRS") or "/etc/xdg").split(":") if folder]
    folders += [Path("/usr/local/etc"), Path("/etc")]
    return [folder / "openxr" / "1" / name for folder in folders for name in ("active_runtime.json", _by_machine())]


def _by_machine() -> str:
    return f"active_runtime.{os.uname().machine}.json" if hasattr(os, "uname") else "active_runtime.json"


def is_installed(environment: Mapping[str, str] = os.environ) -> bool:
    """Whether a runtime's manifest is there; elsewhere than on Linux the loader alone knows, and this says yes."""
    return not sys.platform.startswith("linux") or any(path.is_file() for path in manifest_paths(environment))
