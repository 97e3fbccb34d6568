"""The OpenXR bridge against a scripted runtime that reproduces what was measured on a real one."""

from __future__ import annotations

import itertools
import json
import math
import os
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from threading import Event, Thread
from typing import Any

import pytest
from bridges.pages import Hub, heard
from bridges.scripted_xr import LEFT, RIGHT, VIEW, Device, ScriptedXr
from harness import COMMAND, KEYS, Running, wait_for

from arm_ik_service.bridges.frames import FramePublisher
from arm_ik_service.bridges.openxr.bridge import OpenXrBridge, probe
from arm_ik_service.bridges.openxr.installed import is_installed
from arm_ik_service.bridges.openxr.pyopenxr import PROFILES, PyOpenXr, load_xr
from arm_ik_service.errors import BridgeError
from arm_ik_service.io.session import open_session
from arm_ik_service.wire.messages import ControllerFrame, Space, TrackedPose

pytestmark = pytest.mark.slow  # real processes, one after the other: the default run has three minutes

pytest.importorskip("xr", reason="needs the extra openxr, and libGL for it")

RATE_HZ = 200.0


@pytest.fixture(scope="module")
def xr() -> Any:
    return load_xr()


@pytest.fixture
def scripted(xr: Any) -> ScriptedXr:
    return ScriptedXr(xr)


class Live:
    """A bridge running on a thread over a scripted runtime."""

    def __init__(self, hub: Hub, scripted: ScriptedXr, avatar: str, space: Space | None = None) -> None:
        self.said: list[str] = []
        self.avatar = avatar
        self._hub = hub
        publisher = FramePublisher(hub.bus, KEYS, avatar)
        self.bridge = OpenXrBridge(
            PyOpenXr(scripted), publisher, rate_hz=RATE_HZ, space=space, frozen_after_s=0.2, say=self.said.append
        )
        self.thread = Thread(target=self.bridge.run)
        self.thread.start()

    @property
    def last(self) -> ControllerFrame:
        assert wait_for(lambda: self._hub.count(self.avatar) > 0)
        return self._hub.frames[self.avatar][-1]

    def becomes(self, flags: int | None, seconds: float = 5.0) -> bool:
        """Return whether the right hand's flags became these (None: absent) in time."""
        return wait_for(lambda: (self.last.right.flags if self.last.right else None) == flags, seconds)

    def stop(self) -> None:
        self.bridge.stop()
        self.thread.join(10.0)
        assert not self.thread.is_alive()


@pytest.fixture
def live(hub: Hub, scripted: ScriptedXr, request: pytest.FixtureRequest) -> Iterator[Live]:
    running = Live(hub, scripted, request.node.name.replace("[", "-").replace("]", "")[:60])
    yield running
    running.stop()


def right(frame: ControllerFrame) -> TrackedPose:
    assert frame.right is not None
    return frame.right


def test_head_and_grips_are_published_with_flags_and_velocities_in_the_stage(live: Live) -> None:
    assert live.becomes(0xF)
    frame = live.last
    assert frame.space == "stage"
    assert right(frame).position == pytest.approx((0.0, 1.0, -0.3), abs=1e-5)
    assert right(frame).linear_velocity == pytest.approx((0.1, 0.2, 0.3))
    assert right(frame).angular_velocity == pytest.approx((0.1, 0.2, 0.3))
    assert frame.head is not None
    assert frame.left is not None


def test_frames_come_at_the_chosen_rate_with_sample_times_on_its_grid(hub: Hub, live: Live) -> None:
    assert live.becomes(0xF)
    start = len(hub.frames[live.avatar])
    frames = heard(hub, live.avatar, start + 60)[start:]
    steps = [b.sample_time_ns - a.sample_time_ns for a, b in itertools.pairwise(frames)]
    assert all(step > 0 and step % round(1e9 / RATE_HZ) == 0 for step in steps)
    assert [f.seq for f in frames] == list(range(frames[0].seq, frames[0].seq + len(frames)))
    assert all(abs(f.publish_time_ns - f.sample_time_ns) < 1e9 for f in frames)


def test_poses_are_located_at_the_instances_own_time(live: Live, scripted: ScriptedXr) -> None:
    assert live.becomes(0xF)
    age_ns = time.monotonic_ns() + scripted.offset_ns - scripted.located_at[-1]
    assert 0 <= age_ns < 1e9
    first_offset = scripted.offset_ns
    scripted.dead = True
    assert live.becomes(None)
    scripted.dead = False
    assert live.becomes(0xF)
    assert scripted.offset_ns != first_offset
    assert 0 <= time.monotonic_ns() + scripted.offset_ns - scripted.located_at[-1] < 1e9


def test_a_session_that_is_not_focused_yet_has_no_hands_and_is_no_error(hub: Hub, live: Live) -> None:
    assert live.becomes(0xF)
    first = hub.frames[live.avatar][0]
    assert first.right is None
    assert live.said == []


@pytest.mark.parametrize("flags", [0x0, 0x7, 0x5, 0xA])
def test_partial_flags_of_an_active_controller_are_passed_on(live: Live, scripted: ScriptedXr, flags: int) -> None:
    scripted.devices[RIGHT] = Device(flags=flags, position=(0.0, 0.0, 0.0))
    assert live.becomes(flags)


def test_a_controller_that_is_put_down_and_taken_up_again_comes_and_goes(live: Live, scripted: ScriptedXr) -> None:
    assert live.becomes(0xF)
    scripted.connected = False
    assert live.becomes(None)
    scripted.connected = True
    assert live.becomes(0xF, 2.0)


def test_a_driver_that_dies_is_told_by_its_frozen_pose(live: Live, scripted: ScriptedXr) -> None:
    assert live.becomes(0xF)
    scripted.devices[RIGHT].trembles = False
    assert live.becomes(0x3)
    assert live.last.left is not None
    assert live.last.left.flags == 0xF
    scripted.devices[RIGHT].trembles = True
    assert live.becomes(0xF)


def test_a_runtime_that_dies_in_a_session_loses_the_controllers_and_is_taken_up_again(
    live: Live, scripted: ScriptedXr
) -> None:
    assert live.becomes(0xF)
    scripted.dead = True
    assert live.becomes(None)
    assert live.last.head is None
    assert wait_for(lambda: any("RuntimeFailure" in line and "lost" in line for line in live.said))
    scripted.dead = False
    assert live.becomes(0xF)
    assert live.said[-1] == "the runtime is back: Scripted"
    assert len(live.said) <= 3  # a line a cause, not a line an attempt


def test_a_runtime_that_is_not_up_yet_is_waited_for(
    hub: Hub, scripted: ScriptedXr, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "runtime.json").touch()
    monkeypatch.setenv("XR_RUNTIME_JSON", str(tmp_path / "runtime.json"))
    scripted.unavailable_for = 2
    live = Live(hub, scripted, "late-runtime")
    assert live.becomes(0xF)
    live.stop()
    assert "RuntimeUnavailable" in live.said[0]


def test_a_clock_that_stands_at_zero_is_an_error_of_the_runtimes(hub: Hub, scripted: ScriptedXr) -> None:
    scripted.frozen_clock = True
    live = Live(hub, scripted, "no-clock")
    assert wait_for(lambda: any("clock stands at 0" in line for line in live.said))
    scripted.frozen_clock = False
    assert live.becomes(0xF)
    live.stop()


def test_tracked_hands_are_used_where_no_controller_is_held(live: Live, scripted: ScriptedXr) -> None:
    scripted.wrists = {1: Device(position=(-0.2, 1.1, -0.4)), 2: Device(position=(0.2, 1.1, -0.4))}
    scripted.connected = False
    assert live.becomes(0xF)
    assert wait_for(lambda: right(live.last).position[0] > 0.1)
    assert math.dist(right(live.last).position, (0.2, 1.1, -0.4)) == pytest.approx(math.hypot(0.02, 0.075), abs=1e-4)


def test_stopping_walks_the_session_to_its_end(hub: Hub, scripted: ScriptedXr) -> None:
    live = Live(hub, scripted, "stopped")
    assert live.becomes(0xF)
    live.stop()
    assert scripted.calls == ["begin_session", "request_exit_session", "end_session", "destroy_instance"]


@pytest.mark.parametrize("missing", ["XR_MND_headless", "XR_KHR_convert_timespec_time"])
def test_a_missing_extension_is_named_with_what_to_do(scripted: ScriptedXr, missing: str) -> None:
    scripted.extensions.remove(missing)
    with pytest.raises(BridgeError, match=f"{missing}: .*arm-ik bridge web"):
        PyOpenXr(scripted).create(None)


def test_a_profile_that_a_runtime_lacks_stops_no_other(scripted: ScriptedXr) -> None:
    scripted.unknown_profiles = ("htc/vive_controller", "khr/simple_controller")
    verdicts = PyOpenXr(scripted).create(None).profiles
    assert {p for p, verdict in verdicts.items() if verdict == "accepted"} == set(PROFILES) - set(
        scripted.unknown_profiles
    )


@pytest.mark.parametrize(("kinds", "wanted", "space"), [([1, 2], None, "local"), ([1, 2, 3], "local", "local")])
def test_the_best_space_there_is_is_taken_or_the_one_asked_for(
    scripted: ScriptedXr, kinds: list[int], wanted: Space | None, space: str
) -> None:
    scripted.spaces = kinds
    assert PyOpenXr(scripted).create(wanted).space == space


def test_a_space_that_is_not_there_is_refused_with_those_that_are(scripted: ScriptedXr) -> None:
    with pytest.raises(BridgeError, match="no local_floor space: it offers view, local, stage"):
        PyOpenXr(scripted).create("local_floor")


def test_probe_shows_runtime_extensions_profiles_spaces_and_poses_with_flags(scripted: ScriptedXr) -> None:
    shown: list[str] = []
    scripted.devices[LEFT].flags = 0x7
    probe(PyOpenXr(scripted), space=None, seconds=0.6, show=shown.append, stopped=Event())
    text = "\n".join(shown)
    for word in ("Scripted 25.0.0", "XR_MND_headless", "oculus/touch_controller: accepted", "used: stage", "FOCUSED"):
        assert word in text
    assert any(line.startswith("left") and "flags 0x7" in line and "oculus/touch" in line for line in shown)
    assert any(line.startswith("head") and "flags 0xf" in line and "with velocity" in line for line in shown)
    assert scripted.calls[-1] == "destroy_instance"


def test_probe_of_a_dead_runtime_is_one_error(scripted: ScriptedXr) -> None:
    scripted.dead = True
    with pytest.raises(BridgeError, match="is the runtime's service running"):
        probe(PyOpenXr(scripted), space=None, seconds=0.1, show=print, stopped=Event())


@pytest.mark.parametrize("arguments", [[], ["--probe"]])
def test_without_a_runtime_the_command_ends_with_one_line_that_says_how_to_get_one(
    arguments: list[str], tmp_path: Path
) -> None:
    environment = {**os.environ, "HOME": str(tmp_path), "XDG_CONFIG_HOME": str(tmp_path)}
    environment.pop("XR_RUNTIME_JSON", None)
    if is_installed(environment):
        pytest.skip("an OpenXR runtime is installed for all users of this machine")
    result = subprocess.run(
        [*COMMAND, "bridge", "openxr", *arguments], capture_output=True, text=True, timeout=60, env=environment
    )
    assert result.returncode == 2
    assert len(result.stderr.strip().splitlines()) == 1, result.stderr
    assert "install Monado" in result.stderr


def test_what_it_publishes_is_recorded_and_replayed_identically(hub: Hub, scripted: ScriptedXr, tmp_path: Path) -> None:
    log = tmp_path / "openxr.mcap"
    recorder = Running("record", str(log), "--connect", hub.endpoint)
    time.sleep(1.2)
    scripted.devices[VIEW].flags = 0x7
    live = Live(hub, scripted, "recorded")
    sent = heard(hub, "recorded", 80)
    live.stop()
    sent = heard(hub, "recorded", len(sent))
    assert recorder.end() == 0
    recorded = [r.frame for r in open_session(log).frames() if r.avatar == "recorded"]
    assert recorded == sent
    played = subprocess.run(
        [*COMMAND, "replay", str(log), "--avatar", "replayed", "--json", "--connect", hub.endpoint],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert json.loads(played.stdout)["frames"] == len(sent), played.stderr
    again = heard(hub, "replayed", len(sent))
    for before, after in zip(sent, again, strict=True):
        assert (after.seq, after.sample_time_ns, after.space) == (before.seq, before.sample_time_ns, before.space)
        assert (after.head, after.left, after.right) == (before.head, before.left, before.right)


@pytest.mark.parametrize("command", ["web", "openxr"])
def test_the_help_of_both_bridges_has_an_example(command: str) -> None:
    result = subprocess.run([*COMMAND, "bridge", command, "--help"], capture_output=True, text=True, timeout=60)
    assert result.returncode == 0
    assert f"arm-ik bridge {command}" in result.stdout
