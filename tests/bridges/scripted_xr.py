"""A double of the module `xr`: real types, enums and errors over a runtime that does what Monado 25 was seen to do."""

from __future__ import annotations

import ctypes
import math
from collections import deque
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

IDENTITY = (0.0, 0.0, 0.0, 1.0)
VIEW, STAGE, LEFT, RIGHT = 1, 3, 50, 51  # handles of the spaces


@dataclass
class Device:
    """What the runtime would say of one space."""

    flags: int = 0xF
    position: tuple[float, float, float] = (0.0, 1.0, -0.3)
    orientation: tuple[float, float, float, float] = IDENTITY
    velocity: tuple[float, float, float] | None = (0.1, 0.2, 0.3)
    trembles: bool = True  # in its last bits, as everything that is tracked does


@dataclass
class ScriptedXr:
    """Stands in for the module; a test turns its knobs while the bridge runs."""

    real: Any
    extensions: list[str] = field(
        default_factory=lambda: ["XR_MND_headless", "XR_KHR_convert_timespec_time", "XR_EXT_hand_tracking"]
    )
    spaces: list[int] = field(default_factory=lambda: [1, 2, 3, 1_000_999_000])  # the last nobody has heard of
    unknown_profiles: tuple[str, ...] = ()
    unavailable_for: int = 0  # so many creations fail with RuntimeUnavailable
    dead: bool = False  # every sync fails with RuntimeFailure, and no event says why
    connected: bool = True  # becomes is_active at the next sync, not before
    devices: dict[int, Device] = field(default_factory=lambda: {h: Device() for h in (VIEW, LEFT, RIGHT)})
    wrists: dict[int, Device] = field(default_factory=dict)  # HandEXT -> tracked hand
    frozen_clock: bool = False

    def __post_init__(self) -> None:
        self.calls: list[str] = []
        self.instances = 0
        self.offset_ns = 0
        self.located_at: list[int] = []
        self._states: deque[int] = deque()
        self._paths: list[str] = [""]
        self._running = self._focused = self._active = False
        self._synced = False
        self._count = 0
        self.raw_functions = SimpleNamespace(xrLocateSpace=self._locate)
        self._joints = self.real.PFN_xrLocateHandJointsEXT(self._locate_joints)

    def __getattr__(self, name: str) -> Any:
        if name.startswith(("wait_frame", "begin_frame", "locate_spaces")):
            raise AssertionError(f"{name}: its answer is not to be trusted in a headless session")
        return getattr(self.real, name)

    def enumerate_instance_extension_properties(self) -> list[Any]:
        if self.unavailable_for > 0:
            self.unavailable_for -= 1
            raise self.real.exception.RuntimeUnavailableError
        return [self.real.ExtensionProperties(name) for name in self.extensions]

    def create_instance(self, info: Any) -> Any:
        if self.dead:
            raise self.real.exception.RuntimeFailureError
        self.instances += 1
        self.offset_ns = 777_000_000_000 * self.instances - 10_000_000_000  # XrTime is another clock in every instance
        self._running = self._focused = self._active = self._synced = False
        self._states.clear()
        return ctypes.cast(1, self.real.Instance)

    def destroy_instance(self, _instance: Any) -> None:
        self.calls.append("destroy_instance")
        if self.dead:
            raise self.real.exception.InstanceLostError

    def get_instance_properties(self, _instance: Any) -> Any:
        return self.real.InstanceProperties(self.real.Version(25, 0, 0), "Scripted")

    def get_system(self, _instance: Any, _info: Any) -> int:
        return 1

    def get_system_properties(self, _instance: Any, _system: int) -> Any:
        return SimpleNamespace(system_name=b"double")

    def create_session(self, _instance: Any, _info: Any) -> Any:
        self._states.extend((1, 2))  # IDLE and READY come on the first poll
        return ctypes.cast(2, self.real.Session)

    def enumerate_reference_spaces(self, _session: Any) -> list[int]:
        return self.spaces

    def create_reference_space(self, _session: Any, info: Any) -> Any:
        return ctypes.cast(int(info._reference_space_type), self.real.Space)

    def string_to_path(self, _instance: Any, text: str) -> int:
        if text not in self._paths:
            self._paths.append(text)
        return self._paths.index(text)

    def path_to_string(self, _instance: Any, path: int) -> str:
        return self._paths[path]

    def create_action_set(self, _instance: Any, _info: Any) -> Any:
        return ctypes.cast(5, self.real.ActionSet)

    def create_action(self, _action_set: Any, info: Any) -> Any:
        assert info.count_subaction_paths == 2
        return ctypes.cast(6, self.real.Action)

    def suggest_interaction_profile_bindings(self, _instance: Any, suggested: Any) -> None:
        profile = self._paths[suggested.interaction_profile]
        if profile.endswith(self.unknown_profiles):
            raise self.real.exception.PathUnsupportedError

    def attach_session_action_sets(self, _session: Any, info: Any) -> None:
        assert info.count_action_sets == 1

    def create_action_space(self, _session: Any, info: Any) -> Any:
        return ctypes.cast(LEFT if self._paths[info.subaction_path].endswith("left") else RIGHT, self.real.Space)

    def create_hand_tracker_ext(self, _session: Any, info: Any) -> Any:
        return ctypes.cast(int(info._hand), self.real.HandTrackerEXT)

    def get_instance_proc_addr(self, _instance: Any, name: str) -> Any:
        assert name == "xrLocateHandJointsEXT"
        return self._joints

    def poll_event(self, _instance: Any) -> Any:
        if not self._states:
            raise self.real.EventUnavailable
        state = self._states.popleft()
        self._focused = state == 5
        buffer = self.real.EventDataBuffer()
        changed = self.real.EventDataSessionStateChanged(None, self.real.SessionState(state), 1)
        ctypes.memmove(ctypes.byref(buffer), ctypes.byref(changed), ctypes.sizeof(changed))
        return buffer

    def begin_session(self, _session: Any, _info: Any) -> None:
        self.calls.append("begin_session")
        self._running = True
        self._states.extend((3, 4, 5))

    def request_exit_session(self, _session: Any) -> None:
        self.calls.append("request_exit_session")
        self._states.extend((4, 3, 6))

    def end_session(self, _session: Any) -> None:
        self.calls.append("end_session")
        self._running = False
        self._states.extend((1, 8))

    def sync_actions(self, _session: Any, _info: Any) -> None:
        if self.dead:
            raise self.real.exception.RuntimeFailureError
        if not self._focused:
            raise self.real.SessionNotFocused
        self._synced = True
        self._active = self.connected

    def get_action_state_pose(self, _session: Any, _info: Any) -> Any:
        return SimpleNamespace(is_active=self._active)

    def get_current_interaction_profile(self, _session: Any, _path: int) -> Any:
        return SimpleNamespace(interaction_profile=self._paths.index("/interaction_profiles/oculus/touch_controller"))

    def convert_timespec_time_to_time_khr(self, _instance: Any, moment: Any) -> Any:
        nanoseconds = moment.tv_sec * 1_000_000_000 + moment.tv_nsec + self.offset_ns
        return self.real.Time(0 if self.frozen_clock else nanoseconds)

    def _locate(self, space: Any, base: Any, time: int, out: Any) -> int:
        if time <= 0:
            return int(self.real.Result.ERROR_TIME_INVALID.value)
        assert ctypes.cast(base, ctypes.c_void_p).value == STAGE
        handle = int(ctypes.cast(space, ctypes.c_void_p).value or 0)
        location = ctypes.cast(out, ctypes.POINTER(self.real.SpaceLocation)).contents
        self.located_at.append(time)
        device = self.devices[handle]
        if handle != VIEW and not self._synced:
            device = Device(flags=0, position=(0.0, 0.0, 0.0), velocity=None)
        velocity = ctypes.cast(location.next, ctypes.POINTER(self.real.SpaceVelocity)).contents
        self._fill(device, location, velocity)
        return 0

    def _locate_joints(self, tracker: Any, _info: Any, out: Any) -> int:
        hand = int(ctypes.cast(tracker, ctypes.c_void_p).value or 0)
        locations = out.contents
        device = self.wrists.get(hand)
        locations.is_active = device is not None
        if device is not None:
            velocities = ctypes.cast(locations.next, ctypes.POINTER(self.real.HandJointVelocitiesEXT)).contents
            wrist = int(self.real.HandJointEXT.WRIST)
            self._fill(device, locations._joint_locations[wrist], velocities._joint_velocities[wrist])
        return 0

    def _fill(self, device: Device, location: Any, velocity: Any) -> None:
        self._count += 1
        x, y, z = device.position
        location._location_flags = device.flags
        location.pose.position = self.real.Vector3f(
            x + (1e-6 * math.sin(self._count) if device.trembles else 0.0), y, z
        )
        location.pose.orientation = self.real.Quaternionf(*device.orientation)
        velocity._velocity_flags = 0 if device.velocity is None else 3
        if device.velocity is not None:
            velocity.linear_velocity = self.real.Vector3f(*device.velocity)
            velocity.angular_velocity = self.real.Vector3f(*device.velocity)
