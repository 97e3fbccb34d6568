"""What every recorded session is, whatever file it lies in, and how one is opened: by what the file holds, not by its
name.

A session gives its frames lazily, in the order they were received. A truncated file is still a session: what could be
read is there, and `warnings` says at which byte it ends; only a file that gives nothing at all is a SessionError.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

from arm_ik_service.errors import SessionError
from arm_ik_service.wire.messages import ArmsState, ControllerFrame

DEFAULT_AVATAR = "recorded"  # the avatar id of files that hold one person and no name
NANOSECONDS = 1_000_000_000

MCAP_MAGIC = b"\x89MCAP0\r\n"
BSOR_MAGIC = b"\x69\x3d\x2d\x44"
NPZ_MAGIC = b"PK\x03\x04"  # a zip archive, which is what numpy's .npz is
LONGEST_MAGIC = 8


class RecordedFrame(NamedTuple):
    """One controller frame as it was recorded."""

    avatar: str
    frame: ControllerFrame
    receive_time_ns: int | None  # None: the file does not say; the sample time is then the best guess


class RecordedProfile(NamedTuple):
    """One calibration profile as it was recorded."""

    time_ns: int  # of the log: the service took it over at some frame around then
    json: bytes


class Session(Protocol):
    """One recorded session. Iterating twice reads twice; nothing is held in memory that a block does not need."""

    @property
    def path(self) -> Path:
        """The file."""

    @property
    def avatars(self) -> tuple[str, ...]:
        """The people in it, in order of appearance."""

    @property
    def frame_count(self) -> int | None:
        """How many frames `frames` gives, where that is known without reading them all."""

    @property
    def duration_s(self) -> float | None:
        """First to last frame [s], where that is known without reading them all."""

    @property
    def metadata(self) -> Mapping[str, str | float | bool]:
        """What else the file says about itself: device, height, modifiers. Keys depend on the format."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was wrong but could be lived with, a line each. More may be added while frames are read."""

    def frames(self) -> Iterator[RecordedFrame]:
        """Read the controller frames in order. Raises SessionError if the file can no longer be read."""

    def arms(self) -> Iterator[ArmsState]:
        """Read the recorded answers in order; empty where the file has none."""

    def calibrations(self, avatar: str) -> Sequence[RecordedProfile]:
        """Return the calibration profiles that were recorded of an avatar, by time; empty where there are none."""


def open_session(path: Path) -> Session:
    """Open a recording: `.mcap`, `.bsor` or `.npz`, recognised by its first bytes.

    Raises SessionError, in one line, for a file that is missing, empty, foreign, or damaged before its first frame.
    """
    # Imported here: each reader brings its library with it, and one file needs one of them.
    magic = _first_bytes(path)
    if magic.startswith(MCAP_MAGIC):
        from arm_ik_service.io.recording import open_recording

        return open_recording(path)
    if magic.startswith(BSOR_MAGIC):
        from arm_ik_service.io.bsor import open_bsor

        return open_bsor(path)
    if magic.startswith(NPZ_MAGIC):
        from arm_ik_service.io.npz import open_npz

        return open_npz(path)
    if not magic:
        raise SessionError(f"{path}: the file is empty; was the recorder stopped before its first second?", offset=0)
    if any(known.startswith(magic) for known in (MCAP_MAGIC, BSOR_MAGIC, NPZ_MAGIC)):
        raise SessionError(
            f"{path}: the file ends inside its first {len(magic)} bytes; copy it again", offset=len(magic)
        )
    raise SessionError(
        f"{path}: not a recording: it begins with {magic!r}; .mcap, .bsor and .npz sessions can be read", offset=0
    )


def require_avatar(session: Session, avatar: str | None) -> None:
    """Raise SessionError where a session has no frame of an avatar that is asked for; None asks for everybody."""
    if avatar is not None and avatar not in session.avatars:
        raise SessionError(f"{session.path}: no avatar {avatar!r}; it has {', '.join(session.avatars)}")


def answered_frames(session: Session) -> Iterator[tuple[RecordedFrame | None, ArmsState]]:
    """Read every answer with the frame that it answers, received when the service's stamp says; None: not recorded.

    In the order of the answers, which is that in which they were solved: solving these frames gives the recorded
    answers again. Memory: each frame that has no answer, because a newer one overtook it; all frames where an answer
    has none.
    """
    frames = session.frames()
    waiting: dict[tuple[str, int, int], deque[RecordedFrame]] = defaultdict(deque)
    for arms in session.arms():
        key = (arms.avatar, arms.seq, arms.sample_time_ns)
        while key not in waiting and (recorded := next(frames, None)) is not None:
            waiting[recorded.avatar, recorded.frame.seq, recorded.frame.sample_time_ns].append(recorded)
        if key not in waiting:
            yield None, arms
            continue
        same = waiting[key]  # more than one where a recording was played twice
        yield same.popleft()._replace(receive_time_ns=arms.receive_time_ns), arms
        if not same:
            del waiting[key]


def _first_bytes(path: Path) -> bytes:
    try:
        if path.exists() and not path.is_file():
            raise SessionError(f"{path}: not a file; name one .mcap, .bsor or .npz recording")
        with path.open("rb") as file:
            return file.read(LONGEST_MAGIC)
    except OSError as error:
        raise SessionError(f"{path}: {error.strerror}; check the name and the permissions") from error
    except ValueError as error:  # a null byte in the name
        raise SessionError(f"{str(path)!r}: {error}") from error
