"""The thin part: a headless session through pyopenxr. Calls and conversions only; what to do about them is elsewhere.

Facts it respects, measured on Monado 25: `locate_space` gives no velocity, so the raw function is called with a
SpaceVelocity chained by object; times are ctypes longs; a runtime that lacks a profile refuses its bindings alone.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
from collections.abc import Iterator
from types import ModuleType
from typing import Any

from arm_ik_service.bridges.openxr.installed import HOW_TO_GET_ONE, is_installed
from arm_ik_service.bridges.openxr.lifecycle import State
from arm_ik_service.bridges.openxr.pacing import timespec
from arm_ik_service.bridges.openxr.runtime import Description, Located, LocatedHand, RuntimeAwayError, Sample
from arm_ik_service.errors import BridgeError
from arm_ik_service.wire.messages import SIDES, Quaternion, Side, Space, Vector

PROFILES = (
    "khr/simple_controller",
    "oculus/touch_controller",
    "valve/index_controller",
    "htc/vive_controller",
    "microsoft/motion_controller",
)
HEADLESS = "XR_MND_headless"
TIMESPEC = "XR_KHR_convert_timespec_time"
LOCAL_FLOOR = "XR_EXT_local_floor"
HAND_TRACKING = "XR_EXT_hand_tracking"
_WHY = {
    HEADLESS: "a session without a window needs it: use Monado or SteamVR, or `arm-ik bridge web` in the headset",
    TIMESPEC: "sample times need it: use Monado or SteamVR on Linux, or `arm-ik bridge web` in the headset",
}
_SPACES: tuple[Space, ...] = ("stage", "local_floor", "local")  # in this order of preference


def load_xr() -> ModuleType:
    """Import pyopenxr, its loader quiet. Raises BridgeError where it is missing or cannot be loaded."""
    os.environ.setdefault("XR_LOADER_DEBUG", "none")  # our own line says what is wrong
    try:
        import xr
    except Exception as error:
        # ImportError: not installed. PyOpenGL, which it needs, raises AttributeError and others without libGL.
        if isinstance(error, ModuleNotFoundError) and error.name == "xr":
            raise BridgeError("pyopenxr is missing: pip install 'arm-ik-service[openxr]'") from error
        raise BridgeError(f"pyopenxr cannot be loaded ({error}): apt-get install libgl1") from error
    module: ModuleType = xr
    return module


class PyOpenXr:
    """One runtime at a time, through the module `xr`."""

    def __init__(self, xr: Any) -> None:
        self._xr = xr
        self._instance: Any = None
        self._session: Any = None
        self._base: Any = None
        self._view: Any = None
        self._grip: Any = None
        self._sync_info: Any = None
        self._paths: dict[Side, Any] = {}
        self._grip_spaces: dict[Side, Any] = {}
        self._hand_trackers: dict[Side, Any] = {}
        self._locate_joints: Any = None

    @contextlib.contextmanager
    def _calling(self, what: str) -> Iterator[None]:
        """Turn any error of the runtime's into RuntimeAwayError."""
        try:
            yield
        except self._xr.exception.ErrorResult as error:
            raise RuntimeAwayError(f"the OpenXR runtime failed to {what} ({type(error).__name__}: {error})") from error

    def create(self, space: Space | None) -> Description:
        """Make instance, session, actions and spaces. Raises BridgeError or RuntimeAwayError."""
        xr = self._xr
        try:
            with self._calling("start"):
                offered = tuple(str(entry) for entry in xr.enumerate_instance_extension_properties())
                enabled = self._wanted(offered)
                self._instance = xr.create_instance(
                    xr.InstanceCreateInfo(
                        application_info=xr.ApplicationInfo(
                            application_name="arm-ik bridge", engine_name="arm-ik", api_version=xr.Version(1, 0, 34)
                        ),
                        enabled_extension_names=enabled,
                    )
                )
        except RuntimeAwayError as away:
            if isinstance(away.__cause__, xr.exception.RuntimeUnavailableError) and not is_installed():
                raise BridgeError(HOW_TO_GET_ONE) from away
            raise
        with self._calling("open a session"):
            properties = xr.get_instance_properties(self._instance)
            system_id = xr.get_system(self._instance, xr.SystemGetInfo(xr.FormFactor.HEAD_MOUNTED_DISPLAY))
            system = xr.get_system_properties(self._instance, system_id)
            self._session = xr.create_session(self._instance, xr.SessionCreateInfo(system_id=system_id))
            spaces = tuple(self._space_name(int(kind)) for kind in xr.enumerate_reference_spaces(self._session))
            chosen = _choose(space, spaces)
            self._base = self._reference_space(getattr(xr.ReferenceSpaceType, chosen.upper()))
            self._view = self._reference_space(xr.ReferenceSpaceType.VIEW)
            profiles = self._make_actions()
            self._make_hand_trackers(enabled, system_id)
        return Description(
            runtime=_text(properties.runtime_name),
            version=str(properties.runtime_version),
            system=_text(system.system_name),
            extensions=offered,
            enabled=tuple(enabled),
            spaces=spaces,
            space=chosen,
            profiles=profiles,
        )

    def _wanted(self, offered: tuple[str, ...]) -> list[str]:
        for name, why in _WHY.items():
            if name not in offered:
                raise BridgeError(f"the OpenXR runtime does not offer {name}: {why}")
        return [HEADLESS, TIMESPEC, *(name for name in (LOCAL_FLOOR, HAND_TRACKING) if name in offered)]

    def _reference_space(self, kind: Any) -> Any:
        info = self._xr.ReferenceSpaceCreateInfo(kind, self._xr.Posef())
        return self._xr.create_reference_space(self._session, info)

    def _space_name(self, kind: int) -> str:
        """Name a kind of reference space; a runtime may offer kinds that this pyopenxr has not heard of."""
        try:
            return str(self._xr.ReferenceSpaceType(kind).name).lower()
        except ValueError:
            return str(kind)

    def _make_actions(self) -> dict[str, str]:
        """Make the grip action with its spaces; returns each suggested profile's verdict."""
        xr = self._xr
        action_set = xr.create_action_set(self._instance, xr.ActionSetCreateInfo("arm_ik", "arm-ik"))
        self._paths = {side: xr.string_to_path(self._instance, f"/user/hand/{side}") for side in SIDES}
        self._grip = xr.create_action(
            action_set,
            xr.ActionCreateInfo(
                action_name="grip",
                action_type=xr.ActionType.POSE_INPUT,
                subaction_paths=list(self._paths.values()),
                localized_action_name="Grip pose",
            ),
        )
        verdicts = {profile: self._suggest(profile) for profile in PROFILES}
        xr.attach_session_action_sets(self._session, xr.SessionActionSetsAttachInfo(action_sets=[action_set]))
        self._grip_spaces = {
            side: xr.create_action_space(self._session, xr.ActionSpaceCreateInfo(self._grip, path))
            for side, path in self._paths.items()
        }
        self._sync_info = xr.ActionsSyncInfo(active_action_sets=[xr.ActiveActionSet(action_set, xr.NULL_PATH)])
        return verdicts

    def _suggest(self, profile: str) -> str:
        """Suggest the grips of one interaction profile; a runtime that lacks it refuses this one alone."""
        xr = self._xr
        bindings = [
            xr.ActionSuggestedBinding(
                self._grip, xr.string_to_path(self._instance, f"/user/hand/{side}/input/grip/pose")
            )
            for side in SIDES
        ]
        try:
            xr.suggest_interaction_profile_bindings(
                self._instance,
                xr.InteractionProfileSuggestedBinding(
                    interaction_profile=xr.string_to_path(self._instance, f"/interaction_profiles/{profile}"),
                    suggested_bindings=bindings,
                ),
            )
        except xr.exception.PathUnsupportedError:
            return "not known to this runtime"
        return "accepted"

    def _make_hand_trackers(self, enabled: list[str], system_id: Any) -> None:
        """Make a tracker a hand where the system has hand tracking; without one controllers still work."""
        xr = self._xr
        self._hand_trackers = {}
        if HAND_TRACKING not in enabled:
            return
        with contextlib.suppress(xr.exception.FeatureUnsupportedError):
            for side, hand in (("left", xr.HandEXT.LEFT), ("right", xr.HandEXT.RIGHT)):
                info = xr.HandTrackerCreateInfoEXT(hand, xr.HandJointSetEXT.DEFAULT)
                self._hand_trackers[side] = xr.create_hand_tracker_ext(self._session, info)  # type: ignore[index]
            self._locate_joints = ctypes.cast(
                xr.get_instance_proc_addr(self._instance, "xrLocateHandJointsEXT"), xr.PFN_xrLocateHandJointsEXT
            )

    def poll_states(self) -> list[State]:
        """Return the session states entered since the last call. Raises RuntimeAwayError."""
        xr = self._xr
        states: list[State] = []
        with self._calling("report events"):
            while True:
                try:
                    event = xr.poll_event(self._instance)
                except xr.EventUnavailable:
                    return states
                kind = xr.StructureType(event.type)
                if kind == xr.StructureType.EVENT_DATA_SESSION_STATE_CHANGED:
                    changed = ctypes.cast(ctypes.byref(event), ctypes.POINTER(xr.EventDataSessionStateChanged)).contents
                    states.append(State(int(changed.state.value)))
                elif kind == xr.StructureType.EVENT_DATA_INSTANCE_LOSS_PENDING:
                    states.append(State.LOSS_PENDING)

    def begin(self) -> None:
        """Begin the session."""
        with self._calling("begin the session"):
            self._xr.begin_session(
                self._session, self._xr.SessionBeginInfo(self._xr.ViewConfigurationType.PRIMARY_STEREO)
            )

    def end(self) -> None:
        """End the session."""
        with self._calling("end the session"):
            self._xr.end_session(self._session)

    def request_exit(self) -> None:
        """Ask the session to stop."""
        with self._calling("leave the session"):
            self._xr.request_exit_session(self._session)

    def sync(self) -> bool:
        """Sync the actions; False while the session is not focused."""
        with self._calling("sync actions"):
            try:
                self._xr.sync_actions(self._session, self._sync_info)
            except self._xr.SessionNotFocused:
                return False
        return True

    def xr_time(self, monotonic_ns: int) -> int:
        """Convert a moment of CLOCK_MONOTONIC to XrTime."""
        moment = self._xr.timespec(*timespec(monotonic_ns))
        with self._calling("convert a time"):
            return int(self._xr.convert_timespec_time_to_time_khr(self._instance, moment).value)

    def locate(self, xr_time: int) -> Sample:
        """Locate head, grips and wrists in the base space."""
        with self._calling("locate"):
            hands: dict[Side, LocatedHand] = {}
            for side in SIDES:
                info = self._xr.ActionStateGetInfo(self._grip, self._paths[side])
                active = bool(self._xr.get_action_state_pose(self._session, info).is_active)
                grip = self._locate(self._grip_spaces[side], xr_time)
                hands[side] = LocatedHand(active, grip, self._locate_wrist(side, xr_time))
            return Sample(self._locate(self._view, xr_time), hands)

    def _locate(self, space: Any, xr_time: int) -> Located:
        xr = self._xr
        velocity = xr.SpaceVelocity()
        location = xr.SpaceLocation(next=velocity)  # by object: pyopenxr takes its address itself
        self._check(xr.raw_functions.xrLocateSpace(space, self._base, xr_time, ctypes.byref(location)))
        return _located(location.location_flags, location.pose, velocity)

    def _locate_wrist(self, side: Side, xr_time: int) -> Located | None:
        tracker = self._hand_trackers.get(side)
        if tracker is None:
            return None
        xr = self._xr
        count = xr.HAND_JOINT_COUNT_EXT
        joints, speeds = (xr.HandJointLocationEXT * count)(), (xr.HandJointVelocityEXT * count)()
        velocities = xr.HandJointVelocitiesEXT(joint_velocities=speeds)
        locations = xr.HandJointLocationsEXT(joint_locations=joints, next=velocities)
        info = xr.HandJointsLocateInfoEXT(self._base, xr_time)
        self._check(self._locate_joints(tracker, info, ctypes.byref(locations)))
        if not locations.is_active:
            return None
        wrist = int(xr.HandJointEXT.WRIST)
        return _located(joints[wrist].location_flags, joints[wrist].pose, speeds[wrist])

    def _check(self, result: Any) -> None:
        checked = self._xr.check_result(self._xr.Result(result))
        if checked.is_exception():
            raise checked

    def profiles_in_use(self) -> dict[Side, str]:
        """Return the interaction profile of each hand, where it has one."""
        found: dict[Side, str] = {}
        with self._calling("name its interaction profiles"):
            for side, path in self._paths.items():
                profile = self._xr.get_current_interaction_profile(self._session, path).interaction_profile
                if profile != self._xr.NULL_PATH:
                    found[side] = self._xr.path_to_string(self._instance, profile)
        return found

    def destroy(self) -> None:
        """Destroy the instance and, with it, everything made from it; a runtime that is gone may refuse."""
        if self._instance is not None:
            with contextlib.suppress(self._xr.exception.XrException, OSError):
                self._xr.destroy_instance(self._instance)
        self._instance = self._session = None


def _located(flags: Any, pose: Any, velocity: Any) -> Located:
    return Located(
        flags=int(flags),
        position=_vector(pose.position),
        orientation=_quaternion(pose.orientation),
        velocity_flags=int(velocity.velocity_flags),
        linear_velocity=_vector(velocity.linear_velocity),
        angular_velocity=_vector(velocity.angular_velocity),
    )


def _vector(v: Any) -> Vector:
    return float(v.x), float(v.y), float(v.z)


def _quaternion(q: Any) -> Quaternion:
    return float(q.x), float(q.y), float(q.z), float(q.w)


def _text(value: Any) -> str:
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)


def _choose(wanted: Space | None, offered: tuple[str, ...]) -> Space:
    for space in (wanted,) if wanted else _SPACES:
        if space in offered:
            return space
    raise BridgeError(f"the OpenXR runtime has no {wanted or 'usable'} space: it offers {', '.join(offered)}")
