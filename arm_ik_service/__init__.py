"""Real-time VR arms: headset and controller poses in, two human arms out.

>>> from arm_ik_service import ArmModel, JacobianTranspose
>>> solver = JacobianTranspose(ArmModel.load(side="right"))
>>> solver.solve([0.15, -0.25, -0.30, 0.0, 0.0, 0.0, 1.0]).iterations
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from arm_ik_service.arm.model import ArmModel
    from arm_ik_service.avatar import Avatar, Avatars
    from arm_ik_service.body.profile import Profile
    from arm_ik_service.ik.jacobian_transpose import JacobianTranspose
    from arm_ik_service.io.profile_store import load_profile
    from arm_ik_service.settings import Settings, load_settings
    from arm_ik_service.wire.messages import ArmsState, ControllerFrame, TrackedPose

__version__ = "0.1.0"

# Loaded on first use: the command line shows its help without waiting for Pinocchio and numba.
_HOMES = {
    "ArmModel": "arm.model",
    "ArmsState": "wire.messages",
    "Avatar": "avatar",
    "Avatars": "avatar",
    "ControllerFrame": "wire.messages",
    "JacobianTranspose": "ik.jacobian_transpose",
    "Profile": "body.profile",
    "Settings": "settings",
    "TrackedPose": "wire.messages",
    "load_profile": "io.profile_store",
    "load_settings": "settings",
}
__all__ = [
    "ArmModel",
    "ArmsState",
    "Avatar",
    "Avatars",
    "ControllerFrame",
    "JacobianTranspose",
    "Profile",
    "Settings",
    "TrackedPose",
    "load_profile",
    "load_settings",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
