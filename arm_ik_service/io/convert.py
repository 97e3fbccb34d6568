"""One form of session into another: any readable recording into `.mcap` or `.npz`, frames and their times unchanged."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from heapq import merge
from operator import itemgetter
from pathlib import Path

from arm_ik_service.errors import SessionError
from arm_ik_service.io.npz import NpzSessionWriter
from arm_ik_service.io.recording import RecordingWriter
from arm_ik_service.io.session import RecordedFrame, RecordedProfile, Session, require_avatar
from arm_ik_service.wire.messages import ArmsState

Progress = Callable[[int], None]  # told how many more frames are done
Profiles = list[tuple[int, tuple[str, RecordedProfile]]]  # with their avatars, by the time of each
Messages = Iterator[tuple[int, RecordedFrame | ArmsState | tuple[str, RecordedProfile]]]  # by the time of each
PROGRESS_EVERY = 512  # frames


def convert_session(
    session: Session, output: Path, *, avatar: str | None = None, progress: Progress | None = None
) -> int:
    """Write the frames of a session, of one avatar if named, as the file name asks; returns how many.

    `.mcap` also takes the recorded answers and profiles along; `.npz` holds one person. Raises SessionError for
    another ending, a name that is not in the session, or several people where one must be chosen.
    """
    if output.exists() and output.samefile(session.path):
        raise SessionError(f"{output}: is the session itself; write to another file")
    require_avatar(session, avatar)
    if output.suffix == ".mcap":
        return _to_mcap(session, output, avatar, progress)
    if output.suffix == ".npz":
        return _to_npz(session, output, avatar, progress)
    raise SessionError(f"{output}: a session can be written as .mcap or .npz")


def _to_mcap(session: Session, output: Path, avatar: str | None, progress: Progress | None) -> int:
    count = 0
    metadata = {name: str(value) for name, value in session.metadata.items() if name != "format"}
    frames: Messages = ((_log_time_ns(recorded), recorded) for recorded in _chosen(session, avatar, progress))
    recorded_answers = (answer for answer in session.arms() if avatar in (None, answer.avatar))
    answers: Messages = ((answer.publish_time_ns, answer) for answer in recorded_answers)
    with RecordingWriter(output, {"source": session.path.name, **metadata}) as writer:
        for time_ns, message in _with_profiles(merge(frames, answers, key=itemgetter(0)), _profiles(session, avatar)):
            if isinstance(message, ArmsState):
                writer.write_arms(message.avatar, message, time_ns)
            elif isinstance(message, RecordedFrame):
                writer.write_frame(message.avatar, message.frame, time_ns)
                count += 1
            else:
                writer.write_calibration(message[0], message[1].json, time_ns)
    return count


def _profiles(session: Session, avatar: str | None) -> Profiles:
    names = session.avatars if avatar is None else (avatar,)
    every = [(logged.time_ns, (name, logged)) for name in names for logged in session.calibrations(name)]
    return sorted(every, key=itemgetter(0))


def _with_profiles(messages: Messages, profiles: Profiles) -> Messages:
    """Put each profile before the first message that is not older: those from before all others where these begin."""
    place = 0
    for time_ns, message in messages:
        while place < len(profiles) and profiles[place][0] <= time_ns:
            yield time_ns, profiles[place][1]
            place += 1
        yield time_ns, message
    yield from profiles[place:]


def _to_npz(session: Session, output: Path, avatar: str | None, progress: Progress | None) -> int:
    if avatar is None and len(session.avatars) > 1:
        names = ", ".join(session.avatars)
        raise SessionError(f"{session.path} holds {names}; .npz holds one person: choose one of them")
    writer = NpzSessionWriter(avatar or session.avatars[0])
    for recorded in _chosen(session, avatar, progress):
        writer.write(recorded)
    writer.save(output)
    return len(writer)


def _chosen(session: Session, avatar: str | None, progress: Progress | None) -> Iterator[RecordedFrame]:
    read = 0
    for read, recorded in enumerate(session.frames(), 1):
        if avatar in (None, recorded.avatar):
            yield recorded
        if progress is not None and read % PROGRESS_EVERY == 0:
            progress(PROGRESS_EVERY)
    if progress is not None and read % PROGRESS_EVERY:
        progress(read % PROGRESS_EVERY)


def _log_time_ns(recorded: RecordedFrame) -> int:
    """Return when it was received, or the sample time, which is when it must have been."""
    return recorded.frame.sample_time_ns if recorded.receive_time_ns is None else recorded.receive_time_ns
