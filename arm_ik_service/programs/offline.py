"""Solving a recording without Zenoh, as fast as it goes: the same stages, the same bytes as the live run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from pathlib import Path

import msgspec

from arm_ik_service.avatar import Avatars
from arm_ik_service.body.profile import Profile
from arm_ik_service.errors import SessionError
from arm_ik_service.io.recording import RecordingWriter
from arm_ik_service.io.session import RecordedFrame, Session, require_avatar
from arm_ik_service.io.solution import SolutionWriter
from arm_ik_service.settings import Settings
from arm_ik_service.tracking.state import ACCEPTED
from arm_ik_service.wire.codec import encode
from arm_ik_service.wire.messages import ArmsState

BATCH = 256  # frames solved by one call: enough to make the call's own cost vanish
PAUSE_NS = 1_000_000_000  # stands for the pause that a clock stepping back within a file must have been

Progress = Callable[[int], None]


def profile_in(session: Session, avatar: str) -> Profile | None:
    """Return the profile that a recorded service used in the end for an avatar, if the recording holds one."""
    logged = session.calibrations(avatar)
    return msgspec.json.decode(logged[-1].json, type=Profile) if logged else None


def profiles_for(session: Session, stated: Profile | None = None) -> dict[str, Profile]:
    """Return what each avatar is to be solved with: the stated profile, their recorded one, or an average person's."""
    return {avatar: stated or profile_in(session, avatar) or Profile() for avatar in session.avatars}


def receive_times(frames: Iterator[RecordedFrame]) -> Iterator[tuple[RecordedFrame, int]]:
    """Give every frame a receive time: its own, or the sample time of a file that has none.

    A file is in order by itself, so where its clock steps back the receive time does not: it moves on.
    """
    now_ns, shift_ns, last_ns = 0, 0, None
    for recorded in frames:
        if recorded.receive_time_ns is not None:
            yield recorded, recorded.receive_time_ns
            continue
        sample_ns = recorded.frame.sample_time_ns
        if last_ns is not None and sample_ns < last_ns:
            shift_ns += last_ns - sample_ns + PAUSE_NS
        last_ns = sample_ns
        now_ns = sample_ns + shift_ns
        yield recorded, now_ns


def solve_frames(
    frames: Iterator[RecordedFrame],
    profiles: Mapping[str, Profile],
    settings: Settings,
    progress: Progress | None = None,
) -> Iterator[tuple[RecordedFrame, ArmsState]]:
    """Solve frames in order, each avatar with its profile; yields each accepted frame with its answer.

    `progress` is told how many were read.
    """
    avatars: dict[str, int] = {}
    table = Avatars(settings, capacity=1, batch=BATCH)
    stream = receive_times(frames)
    while block := list(islice(stream, BATCH)):
        for recorded, now_ns in block:
            index = avatars.get(recorded.avatar)
            if index is None:
                index = avatars[recorded.avatar] = len(avatars)
                table.reserve(len(avatars))
                table.reset(index, profiles[recorded.avatar])
            table.add(index, recorded.frame, now_ns)
        table.step()
        for place, (recorded, now_ns) in enumerate(block):
            if table.verdicts[place] == ACCEPTED:
                yield recorded, table.answer(place, recorded.frame, recorded.avatar, now_ns)
        if progress is not None:
            progress(len(block))


def save_solution(
    output: Path,
    session: Session,
    answers: Iterator[tuple[RecordedFrame, ArmsState]],
    profiles: Mapping[str, Profile],
    avatar: str | None = None,
) -> int:
    """Write answers as arrays (`.npz`) or as a recording (`.mcap`); returns how many. Raises SessionError."""
    require_avatar(session, avatar)
    count = 0
    if output.suffix == ".mcap":
        described: set[str] = set()
        with RecordingWriter(output) as writer:
            for recorded, answer in answers:
                if recorded.avatar not in described:
                    described.add(recorded.avatar)
                    writer.write_calibration(
                        recorded.avatar, encode(profiles[recorded.avatar], "json"), answer.receive_time_ns
                    )
                writer.write_frame(recorded.avatar, recorded.frame, answer.receive_time_ns)
                writer.write_arms(recorded.avatar, answer, answer.receive_time_ns)
                count += 1
        return count
    if avatar is None and len(session.avatars) > 1:
        names = ", ".join(session.avatars)
        raise SessionError(f"{session.path} holds {names}; arrays are of one person: choose with --avatar")
    profile = profiles[avatar] if avatar is not None else next(iter(profiles.values()), Profile())
    arrays = SolutionWriter(profile.grip.left.position_m, profile.grip.right.position_m)
    for _, answer in answers:
        arrays.write(answer)
    arrays.save(output)
    return len(arrays)
