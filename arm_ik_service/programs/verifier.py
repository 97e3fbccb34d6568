"""Solving again what a service answered while it was recorded, and comparing every byte that it published.

A person may have been measured meanwhile: a profile that was published took effect between two answers, and which two
nobody recorded. So where an answer differs, the profiles that came later are tried as the service takes them over.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass

import msgspec

from arm_ik_service.avatar import Avatars
from arm_ik_service.body.profile import Profile
from arm_ik_service.errors import DecodeError, ModelError, ProfileError
from arm_ik_service.io.session import RecordedFrame, RecordedProfile, Session, answered_frames
from arm_ik_service.settings import Settings
from arm_ik_service.tracking.state import ACCEPTED
from arm_ik_service.wire.codec import MapDecoder
from arm_ik_service.wire.messages import ArmsState

NOW, BEFORE = 0, 1  # rows: the person, and as they were one frame ago

_profiles = MapDecoder(Profile)


@dataclass
class Verification:
    """How a recording's answers compare with solving its frames again."""

    compared: int = 0
    different: int = 0
    first_difference: str | None = None
    unanswered: int = 0  # recorded answers whose frame is not in the recording
    measured_anew: int = 0  # profiles that took effect while it was recorded


def without_clock(state: ArmsState) -> ArmsState:
    """Return the message without the two times that only a running service can measure."""
    return msgspec.structs.replace(state, solve_time_ns=0, publish_time_ns=0)


class _Person:
    """One avatar, solved again frame by frame."""

    def __init__(self, settings: Settings, stated: Profile | None, logged: Sequence[RecordedProfile]) -> None:
        profiles = list(_readable(logged))
        self._later = profiles if stated else profiles[1:]  # those that did not come into force yet
        self._first = stated or (profiles[0] if profiles else Profile())
        self._forgotten_after_ns = int(1e9 * settings.service.forget_after_s)
        self._avatars = Avatars(settings, capacity=2)
        self._avatars.reset(NOW, self._first)
        self._last: ArmsState | None = None
        self.measured_anew = 0

    def same_again(self, recorded: RecordedFrame, published: ArmsState) -> bool:
        """Whether this frame gives this answer again."""
        self._avatars.copy(NOW, BEFORE)
        same = self._gives(recorded, published) or self._after_a_change(recorded, published)
        if not same:  # go on as if it were
            self._avatars.copy(BEFORE, NOW)
            self._gives(recorded, published)
        self._last = published
        return same

    def _gives(self, recorded: RecordedFrame, published: ArmsState) -> bool:
        avatars, now_ns = self._avatars, published.receive_time_ns
        place = avatars.add(NOW, recorded.frame, now_ns)
        avatars.step()
        if avatars.verdicts[place] != ACCEPTED:
            return False
        again = avatars.answer(place, recorded.frame, recorded.avatar, now_ns)
        return msgspec.msgpack.encode(again) == msgspec.msgpack.encode(without_clock(published))

    def _after_a_change(self, recorded: RecordedFrame, published: ArmsState) -> bool:
        """Whether it does so once the person was measured anew, or forgotten, since the frame before."""
        last = self._last
        if last is not None and published.receive_time_ns - last.receive_time_ns >= self._forgotten_after_ns:
            self._avatars.reset(NOW, self._first)
            if self._gives(recorded, published):
                return True
        for place, profile in enumerate(self._later, 1):
            with suppress(ModelError, ProfileError):  # the service refused it, too
                self._avatars.reset(NOW, profile)
                if last is not None:
                    self._avatars.resume(NOW, last)
                if self._gives(recorded, published):
                    self._later = self._later[place:]
                    self.measured_anew += 1
                    return True
        return False


def _readable(logged: Sequence[RecordedProfile]) -> Iterator[Profile]:
    """Those that the service could read."""
    for profile in logged:
        with suppress(DecodeError):
            yield _profiles.decode(profile.json)


def verify_session(
    session: Session, profile: Profile | None, settings: Settings, progress: Callable[[int], None] | None = None
) -> Verification:
    """Solve what the service accepted, at the receive times it stamped, and compare every byte it published.

    `profile` is what the service began with; None takes the first that was recorded. The recording has to begin with
    the avatar's first frame: what the arm does depends on what it did. `progress` is told of every answer.
    """
    result = Verification()
    people: dict[str, _Person] = {}
    for recorded, published in answered_frames(session):
        if progress is not None:
            progress(1)
        if recorded is None:
            result.unanswered += 1
            continue
        person = people.get(published.avatar)
        if person is None:
            logged = session.calibrations(published.avatar)
            person = people[published.avatar] = _Person(settings, profile, logged)
        result.compared += 1
        if not person.same_again(recorded, published):
            result.different += 1
            result.first_difference = result.first_difference or f"avatar {published.avatar}, seq {published.seq}"
    result.measured_anew = sum(person.measured_anew for person in people.values())
    return result
