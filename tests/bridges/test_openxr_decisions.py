"""What the OpenXR bridge decides without any runtime: states, deadlines, flags, frozen poses, where to look for one."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from arm_ik_service.bridges.openxr.installed import manifest_paths
from arm_ik_service.bridges.openxr.lifecycle import Lifecycle, State, Step
from arm_ik_service.bridges.openxr.pacing import Backoff, Pacer, SampleClock, timespec
from arm_ik_service.bridges.openxr.poses import Stillness, hand_pose, tracked_pose
from arm_ik_service.bridges.openxr.runtime import Located, LocatedHand
from arm_ik_service.wire.messages import TrackedPose

WHOLE = Located(0xF, (0.1, 1.2, -0.3), (0.0, 0.0, 0.0, 1.0), 3, (0.1, 0.0, 0.0), (0.0, 0.2, 0.0))


def test_a_session_is_begun_once_ended_once_and_left_at_exiting() -> None:
    lifecycle = Lifecycle()
    way = [
        State.IDLE,
        State.READY,
        State.SYNCHRONIZED,
        State.VISIBLE,
        State.FOCUSED,
        State.VISIBLE,
        State.SYNCHRONIZED,
        State.STOPPING,
        State.IDLE,
        State.EXITING,
    ]
    steps = [(state, step) for state in way if (step := lifecycle.enter(state)) is not None]
    assert steps == [(State.READY, Step.BEGIN), (State.STOPPING, Step.END), (State.EXITING, Step.LEAVE)]
    assert lifecycle.over


@given(st.lists(st.sampled_from(State), max_size=30))
def test_whatever_the_order_of_states_begin_and_end_alternate(way: list[State]) -> None:
    lifecycle = Lifecycle()
    steps = [step for state in way if (step := lifecycle.enter(state)) in (Step.BEGIN, Step.END)]
    for before, after in itertools.pairwise(steps):
        assert (before, after) != (Step.END, Step.END)
    assert not steps or steps[0] is Step.BEGIN


@given(st.floats(1.0, 1000.0), st.lists(st.integers(0, 50_000_000), min_size=1, max_size=200))
def test_deadlines_are_absolute_and_missed_ones_are_skipped(rate_hz: float, delays_ns: list[int]) -> None:
    period_ns = round(1e9 / rate_hz)
    pacer, now_ns, last_ns = Pacer(rate_hz, 0), 0, -1
    for delay_ns in delays_ns:
        deadline_ns = pacer.next_deadline(now_ns)
        assert deadline_ns % period_ns == 0
        assert deadline_ns > last_ns
        assert deadline_ns > now_ns - period_ns
        last_ns, now_ns = deadline_ns, max(now_ns, deadline_ns) + delay_ns


def test_sample_times_run_with_the_monotonic_clock_from_the_wall_clock() -> None:
    clock = SampleClock(monotonic_ns=500, wall_ns=1_700_000_000_000_000_000)
    assert clock.sample_time_ns(500) == 1_700_000_000_000_000_000
    assert clock.sample_time_ns(11_500) - clock.sample_time_ns(500) == 11_000


@given(st.integers(-(10**18), 10**18))
def test_a_timespec_has_its_nanoseconds_in_range(time_ns: int) -> None:
    seconds, nanoseconds = timespec(time_ns)
    assert 0 <= nanoseconds < 10**9
    assert seconds * 10**9 + nanoseconds == time_ns


def test_backoff_doubles_up_to_its_limit_and_begins_again_after_success() -> None:
    backoff = Backoff(0.25, 2.0)
    assert [backoff.failed() for _ in range(5)] == [0.25, 0.5, 1.0, 2.0, 2.0]
    backoff.succeeded()
    assert backoff.failed() == 0.25


@pytest.mark.parametrize("flags", [0xF, 0x7, 0x5, 0xA, 0x3, 0x0])
def test_flags_are_passed_on_as_they_are_and_only_what_is_valid_has_numbers(flags: int) -> None:
    pose = tracked_pose(Located(flags, (0.1, 1.2, -0.3), (0.0, 0.0, 1.0, 0.0)))
    assert pose.flags == flags
    assert pose.position == ((0.1, 1.2, -0.3) if flags & 2 else (0.0, 0.0, 0.0))
    assert pose.orientation == ((0.0, 0.0, 1.0, 0.0) if flags & 1 else (0.0, 0.0, 0.0, 1.0))


def test_tracked_without_valid_and_numbers_that_are_none_are_not_believed() -> None:
    assert tracked_pose(Located(0xC)).flags == 0
    assert tracked_pose(Located(0xF, (math.nan, 0.0, 0.0))).flags == 0x5
    assert tracked_pose(Located(0xF, orientation=(0.0, 0.0, 0.0, 0.0))).flags == 0xA
    assert tracked_pose(Located(0xF, orientation=(math.nan, 0.0, 0.0, 1.0))).flags == 0xA
    assert tracked_pose(Located(0xFFF0 | 0xF)).flags == 0xF


def test_a_velocity_is_there_only_where_it_is_valid() -> None:
    assert tracked_pose(WHOLE).linear_velocity == (0.1, 0.0, 0.0)
    only_turning = Located(0xF, velocity_flags=2, angular_velocity=(0.0, 0.2, 0.0))
    assert tracked_pose(only_turning).linear_velocity is None
    assert tracked_pose(only_turning).angular_velocity == (0.0, 0.2, 0.0)
    assert tracked_pose(Located(0xF, velocity_flags=3, linear_velocity=(math.inf, 0.0, 0.0))).linear_velocity is None


def test_a_controller_goes_before_a_tracked_hand_and_an_unlocated_one_after_it() -> None:
    wrist = Located(0xF, (0.5, 1.0, -0.2))
    assert hand_pose("left", LocatedHand(True, WHOLE, wrist)) == tracked_pose(WHOLE)
    from_wrist = hand_pose("left", LocatedHand(False, WHOLE, wrist))
    assert from_wrist is not None
    assert math.dist(from_wrist.position, wrist.position) == pytest.approx(math.hypot(0.02, 0.075))
    assert hand_pose("left", LocatedHand(True, Located(0), wrist)) == from_wrist
    assert hand_pose("left", LocatedHand(True, Located(0), Located(0))) == tracked_pose(Located(0))
    assert hand_pose("left", LocatedHand(False, WHOLE)) is None


def test_a_pose_that_does_not_change_by_a_bit_becomes_inferred_and_recovers_at_once() -> None:
    still, pose = Stillness(after_ns=500), tracked_pose(WHOLE)
    flags = [checked.flags for now in (0, 100, 499, 500, 900) if (checked := still.check(pose, now)) is not None]
    assert flags == [0xF, 0xF, 0xF, 0x3, 0x3]
    x, y, z = pose.position
    moved = TrackedPose((math.nextafter(x, 1.0), y, z), pose.orientation, pose.flags)
    assert still.check(moved, 901) == moved


def test_stillness_can_be_turned_off_and_forgets_a_device_that_was_absent() -> None:
    pose = tracked_pose(WHOLE)
    never, still = Stillness(after_ns=0), Stillness(after_ns=500)
    for now in (0, 10_000):
        assert never.check(pose, now) == pose
    assert still.check(pose, 0) == pose
    assert still.check(None, 400) is None
    assert still.check(pose, 700) == pose


def test_the_runtimes_manifest_is_looked_for_where_the_loader_looks() -> None:
    assert manifest_paths({"XR_RUNTIME_JSON": "/opt/rt.json"}) == [Path("/opt/rt.json")]
    paths = manifest_paths({"HOME": "/home/a", "XDG_CONFIG_DIRS": "/x:/y"})
    assert paths[0] == Path("/home/a/.config/openxr/1/active_runtime.json")
    assert Path("/y/openxr/1/active_runtime.json") in paths
    assert Path("/etc/openxr/1/active_runtime.json") in paths
