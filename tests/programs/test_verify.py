"""Solving a recording again: the same bytes, whoever was measured anew meanwhile, and a difference where one is."""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice
from pathlib import Path

import msgspec
import pytest

from arm_ik_service.avatar import Avatars
from arm_ik_service.body.profile import BodyMeasures, Profile
from arm_ik_service.io.recording import RecordingWriter
from arm_ik_service.io.session import open_session
from arm_ik_service.programs.demo import bundled_session
from arm_ik_service.programs.verifier import Verification, verify_session
from arm_ik_service.settings import ServiceSettings, Settings
from arm_ik_service.tracking.state import ACCEPTED
from arm_ik_service.wire.codec import encode
from arm_ik_service.wire.messages import ArmsState

FRAMES = 300
PROFILES = [Profile(), *(Profile(BodyMeasures(1.6, 0.3 + 0.01 * k, 0.25)) for k in range(3))]
MS = 1_000_000


def served(
    path: Path,
    *,
    changes: dict[int, Profile],
    first: Profile = PROFILES[0],
    logged_late: int = 0,
    described: bool = True,
    change: Callable[[ArmsState], ArmsState] = lambda answer: answer,
    pause_before: int = FRAMES,
    pause_ns: int = 0,
) -> Path:
    """What a service does that takes over a new profile before some frames, and a recorder's log of it."""
    avatars, last = Avatars(), None
    avatars.reset(0, first)
    frames = [recorded.frame for recorded in islice(open_session(bundled_session("boxing")).frames(), FRAMES)]
    with RecordingWriter(path) as writer:
        if described:
            writer.write_calibration("ann", encode(first, "json"), 0)
        for k, frame in enumerate(frames):
            now_ns = 10**9 + k * 14 * MS + (pause_ns if k >= pause_before else 0)
            if k == pause_before:
                avatars.reset(0, first)
            if k in changes:
                avatars.reset(0, changes[k])
                if last is not None:
                    avatars.resume(0, last)
                writer.write_calibration("ann", encode(changes[k], "json"), now_ns + logged_late * 14 * MS)
            place = avatars.add(0, frame, now_ns)
            avatars.step()
            assert avatars.verdicts[place] == ACCEPTED
            last = avatars.answer(place, frame, "ann", now_ns)
            writer.write_frame("ann", frame, now_ns)
            writer.write_arms("ann", change(last), now_ns + MS)
    return path


def verified(path: Path, settings: Settings | None = None, profile: Profile | None = None) -> Verification:
    return verify_session(open_session(path), profile, settings or Settings())


@pytest.mark.parametrize("logged_late", [-4, 0, 4])
def test_profiles_published_meanwhile_are_found_where_they_took_effect(tmp_path: Path, logged_late: int) -> None:
    changes = {100: PROFILES[1], 101: PROFILES[2], 220: PROFILES[3], 250: PROFILES[3]}
    result = verified(served(tmp_path / "a.mcap", changes=changes, logged_late=logged_late))
    assert (result.compared, result.different, result.measured_anew) == (FRAMES, 0, 4)


def test_a_person_measured_before_their_first_frame_begins_with_that_profile(tmp_path: Path) -> None:
    result = verified(served(tmp_path / "a.mcap", changes={0: PROFILES[2]}))
    assert (result.different, result.measured_anew) == (0, 1)


def test_a_profile_that_the_service_refused_changes_nothing(tmp_path: Path) -> None:
    path = served(tmp_path / "a.mcap", changes={100: PROFILES[1]})
    copy = tmp_path / "b.mcap"
    session = open_session(path)
    with RecordingWriter(copy) as writer:
        for logged in session.calibrations("ann"):
            writer.write_calibration("ann", b'{"body": {"stature_m": 17}}', logged.time_ns)
            writer.write_calibration("ann", logged.json, logged.time_ns)
        for recorded, answer in zip(session.frames(), session.arms(), strict=True):
            writer.write_frame("ann", recorded.frame, recorded.receive_time_ns or 0)
            writer.write_arms("ann", answer, answer.receive_time_ns)
    result = verified(copy)
    assert (result.compared, result.different, result.measured_anew) == (FRAMES, 0, 1)


def test_someone_who_was_silent_until_they_were_forgotten_begins_anew(tmp_path: Path) -> None:
    path = served(tmp_path / "a.mcap", changes={}, pause_before=150, pause_ns=3 * 10**9)
    assert verified(path, Settings(service=ServiceSettings(forget_after_s=2.0))).different == 0
    assert verified(path).different > 0


def test_one_answer_that_is_not_what_is_solved_is_one_difference_and_named(tmp_path: Path) -> None:
    def forge(answer: ArmsState) -> ArmsState:
        if answer.seq != 200:
            return answer
        return msgspec.structs.replace(answer, right=msgspec.structs.replace(answer.right, reach_ratio=0.5))

    result = verified(served(tmp_path / "a.mcap", changes={100: PROFILES[1]}, change=forge))
    assert (result.compared, result.different, result.first_difference) == (FRAMES, 1, "avatar ann, seq 200")


def test_a_profile_that_was_not_recorded_is_a_difference_unless_it_is_stated(tmp_path: Path) -> None:
    path = served(tmp_path / "a.mcap", changes={}, first=PROFILES[1], described=False)
    assert verified(path).different > 0
    assert verified(path, profile=PROFILES[1]).different == 0
