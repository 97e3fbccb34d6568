"""A recorded session in another dialect: `.bvh`, `.csv`, `.parquet`, or `.mcap` for Foxglove, ROS 2 or OpenXR people.

The recorded answers are written; a session that has none is solved first. Memory does not grow with the session.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from arm_ik_service.body.profile import Profile
from arm_ik_service.errors import SessionError, SettingsError
from arm_ik_service.exports.dialects import McapDialect
from arm_ik_service.exports.extras import optional_libraries
from arm_ik_service.exports.mcap_files import WRITERS, StateWriter
from arm_ik_service.exports.mirror import mirrored
from arm_ik_service.io.session import Session, require_avatar
from arm_ik_service.programs.offline import profiles_for, solve_frames
from arm_ik_service.settings import Settings
from arm_ik_service.wire.messages import ArmsState

SUFFIXES = (".bvh", ".csv", ".parquet")
PROGRESS_EVERY = 512  # states

Progress = Callable[[int], None]


def is_export(output: Path, dialect: McapDialect | None) -> bool:
    """Whether a file is to be written here, and not as a session of ours."""
    return dialect is not None or output.suffix in SUFFIXES


def export_session(
    session: Session,
    output: Path,
    *,
    dialect: McapDialect | None = None,
    avatar: str | None = None,
    mirror: bool = False,
    fps: float | None = None,
    profile: Profile | None = None,
    settings: Settings | None = None,
    progress: Progress | None = None,
) -> int:
    """Write the states of a session, of one avatar if named, as the file name and the dialect ask; returns how many.

    The file appears whole or not at all. Raises SessionError or SettingsError for what cannot be done.
    """
    require_avatar(session, avatar)
    if output.suffix == ".bvh" and avatar is None and len(session.avatars) > 1:
        names = ", ".join(session.avatars)
        raise SessionError(f"{session.path} holds {names}; .bvh holds one person: choose with --avatar")
    if fps is not None and output.suffix != ".bvh":
        raise SettingsError("--fps is for .bvh; the other files keep every state with its time")
    part = output.with_name(f"{output.stem}.part{output.suffix}")
    writer = _writer(part, output, dialect, fps)
    count = 0
    try:
        try:
            for state in _states(session, avatar, profile, settings, progress):
                writer.add(mirrored(state) if mirror else state)
                count += 1
        finally:
            writer.close()
        if count == 0:
            raise SessionError(f"{session.path}: there is no state to write")
        part.replace(output)
    except OSError as error:
        raise SessionError(f"{output}: cannot be written: {error.strerror}") from error
    finally:
        part.unlink(missing_ok=True)
    return count


def _writer(part: Path, output: Path, dialect: McapDialect | None, fps: float | None) -> StateWriter:
    if (output.suffix == ".mcap") != (dialect is not None):
        raise SettingsError(f"{output}: --dialect {dialect or ''} is for .mcap files")
    with optional_libraries():
        if dialect is not None:
            return WRITERS[dialect](part)
        if output.suffix == ".bvh":
            from arm_ik_service.exports.bvh import BvhWriter

            return BvhWriter(part, fps)
        from arm_ik_service.exports.table import TableWriter

        return TableWriter(part)


def _states(
    session: Session,
    avatar: str | None,
    profile: Profile | None,
    settings: Settings | None,
    progress: Progress | None,
) -> Iterator[ArmsState]:
    """Give the recorded answers, or solve; a profile or settings that are named mean: solve."""
    solve = profile is not None or settings is not None or next(session.arms(), None) is None
    if solve:
        frames = (recorded for recorded in session.frames() if avatar in (None, recorded.avatar))
        used = profiles_for(session, profile)
        for _, state in solve_frames(frames, used, settings or Settings(), progress):
            yield state
        return
    read = 0
    for read, state in enumerate(session.arms(), 1):
        if avatar in (None, state.avatar):
            yield state
        if progress is not None and read % PROGRESS_EVERY == 0:
            progress(PROGRESS_EVERY)
    if progress is not None and read % PROGRESS_EVERY:
        progress(read % PROGRESS_EVERY)
