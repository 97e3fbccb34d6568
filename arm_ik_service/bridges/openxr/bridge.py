"""The loop: a runtime's session kept alive, its poses sampled on time, whatever the runtime does meanwhile."""

from __future__ import annotations

import time
from collections.abc import Callable
from threading import Event

from arm_ik_service.bridges.frames import FramePublisher
from arm_ik_service.bridges.openxr.lifecycle import Lifecycle, Step
from arm_ik_service.bridges.openxr.pacing import Backoff, Pacer, SampleClock
from arm_ik_service.bridges.openxr.poses import Stillness, hand_pose, tracked_pose
from arm_ik_service.bridges.openxr.runtime import Description, Runtime, RuntimeAwayError, Sample
from arm_ik_service.errors import BridgeError
from arm_ik_service.wire.messages import SIDES, Side, Space, TrackedPose

IDLE_RATE_HZ = 20.0  # of polling while the session does not run, and of frames that say that all is lost
EXIT_WITHIN_S = 2.0  # for the runtime to walk its states to EXITING


class OpenXrBridge:
    """Publishes one avatar's frames from a runtime until `stop`."""

    def __init__(
        self,
        runtime: Runtime,
        publisher: FramePublisher,
        *,
        rate_hz: float,
        space: Space | None,
        frozen_after_s: float,
        say: Callable[[str], None],
    ) -> None:
        self._runtime = runtime
        self._publisher = publisher
        self._rate_hz = rate_hz
        self._wanted_space = space
        self._space: Space = space or "stage"
        self._frozen_after_ns = int(frozen_after_s * 1e9)
        self._say = say
        self._stopped = Event()
        self._clock = SampleClock(time.monotonic_ns(), time.time_ns())
        self._new_session()

    def _new_session(self) -> None:
        self._lifecycle = Lifecycle()
        self._stillness = {name: Stillness(self._frozen_after_ns) for name in ("head", *SIDES)}

    def stop(self) -> None:
        """Make `run` end the session and return; safe in a signal handler."""
        self._stopped.set()

    def run(self, described: Callable[[Description], None] | None = None) -> None:
        """Publish until `stop`, waiting for a runtime that is away. Raises BridgeError for what waiting cannot mend."""
        backoff = Backoff()
        said = ""
        while not self._stopped.is_set():
            try:
                self._new_session()
                description = self._runtime.create(self._wanted_space)
                self._space = description.space
                if said:
                    self._say(f"the runtime is back: {description.runtime}")
                said = ""
                if described is not None:
                    described(description)
                backoff.succeeded()
                self._session()
                if not self._stopped.is_set():
                    self._say("the runtime ended the session; asking for a new one")
            except RuntimeAwayError as away:
                if str(away) != said:
                    said = str(away)
                    self._say(f"{said}; both controllers are lost until it is back, trying again")
            finally:
                self._runtime.destroy()
            self._publish_lost(backoff.failed())

    def _publish_lost(self, wait_s: float) -> None:
        """Say for so long that nothing is tracked."""
        until_s = time.monotonic() + wait_s
        while not self._stopped.is_set() and time.monotonic() < until_s:
            self._publisher.publish(self._clock.sample_time_ns(time.monotonic_ns()), self._space, None, None, None)
            self._stopped.wait(1.0 / IDLE_RATE_HZ)

    def _session(self) -> None:
        """Follow one session to its end. Raises RuntimeAwayError."""
        pacer = Pacer(self._rate_hz, time.monotonic_ns())
        leaving_s: float | None = None
        while not self._lifecycle.over:
            for state in self._runtime.poll_states():
                self._step(self._lifecycle.enter(state))
            if self._stopped.is_set():
                if leaving_s is None:
                    leaving_s = time.monotonic()
                    if not self._lifecycle.running:
                        return
                    self._runtime.request_exit()
                elif time.monotonic() - leaving_s > EXIT_WITHIN_S:
                    return
                time.sleep(0.005)
            elif self._lifecycle.running:
                self._sample(pacer)
            else:
                self._publish_lost(1.0 / IDLE_RATE_HZ)

    def _step(self, step: Step | None) -> None:
        if step is Step.BEGIN:
            self._runtime.begin()
        elif step is Step.END:
            self._runtime.end()

    def _sample(self, pacer: Pacer) -> None:
        """Wait for the next deadline, locate everything at it and publish."""
        deadline_ns = pacer.next_deadline(time.monotonic_ns())
        if self._stopped.wait(max(0.0, (deadline_ns - time.monotonic_ns()) / 1e9)):
            return
        focused = self._runtime.sync()
        xr_time = self._runtime.xr_time(deadline_ns)
        if xr_time <= 0:
            raise RuntimeAwayError(f"the runtime's clock stands at {xr_time}")
        sample = self._runtime.locate(xr_time)
        head, hands = self.decide(sample, focused, deadline_ns)
        self._publisher.publish(
            self._clock.sample_time_ns(deadline_ns), self._space, head, hands["left"], hands["right"]
        )

    def decide(
        self, sample: Sample, focused: bool, now_ns: int
    ) -> tuple[TrackedPose | None, dict[Side, TrackedPose | None]]:
        """Return what the frame says of the head and of both hands."""
        head = self._stillness["head"].check(tracked_pose(sample.head), now_ns)
        hands: dict[Side, TrackedPose | None] = {}
        for side in SIDES:
            located = sample.hands.get(side)
            pose = hand_pose(side, located) if focused and located is not None else None
            hands[side] = self._stillness[side].check(pose, now_ns)
        return head, hands


def check(runtime: Runtime, space: Space | None) -> None:
    """Raise BridgeError for what waiting cannot mend; a runtime that is merely away passes."""
    try:
        runtime.create(space)
    except RuntimeAwayError:
        pass
    finally:
        runtime.destroy()


def probe(
    runtime: Runtime, *, space: Space | None, seconds: float, show: Callable[[str], None], stopped: Event
) -> None:
    """Show what a runtime is and a few seconds of its poses. Raises BridgeError where there is none to show."""
    try:
        _show_description(runtime.create(space), show)
        lifecycle = Lifecycle()
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s and not lifecycle.over and not stopped.is_set():
            for state in runtime.poll_states():
                show(f"state        {state.name}")
                step = lifecycle.enter(state)
                if step is Step.BEGIN:
                    runtime.begin()
                elif step is Step.END:
                    runtime.end()
            if lifecycle.running:
                focused = runtime.sync()
                _show_sample(runtime.locate(runtime.xr_time(time.monotonic_ns())), focused, runtime, show)
            stopped.wait(0.25)
        if lifecycle.running:
            runtime.request_exit()
    except RuntimeAwayError as away:
        raise BridgeError(f"{away}: is the runtime's service running, is the headset connected?") from away
    finally:
        runtime.destroy()


def _show_description(description: Description, show: Callable[[str], None]) -> None:
    show(f"runtime      {description.runtime} {description.version}, system {description.system!r}")
    show(f"extensions   {', '.join(description.extensions)}")
    show(f"enabled      {', '.join(description.enabled)}")
    for profile, verdict in description.profiles.items():
        show(f"profile      {profile}: {verdict}")
    show(f"spaces       {', '.join(description.spaces)}; used: {description.space}")


def _show_sample(sample: Sample, focused: bool, runtime: Runtime, show: Callable[[str], None]) -> None:
    def words(pose: TrackedPose | None) -> str:
        if pose is None:
            return "absent"
        x, y, z = pose.position
        speed = "" if pose.linear_velocity is None else " with velocity"
        return f"flags {pose.flags:#x} at {x:+.3f} {y:+.3f} {z:+.3f}{speed}"

    profiles = runtime.profiles_in_use()
    show(f"head         {words(tracked_pose(sample.head))}" + ("" if focused else " (session not focused)"))
    for side in SIDES:
        located = sample.hands.get(side)
        pose = hand_pose(side, located) if located is not None and focused else None
        show(f"{side:12s} {words(pose)} {profiles.get(side, '')}".rstrip())
