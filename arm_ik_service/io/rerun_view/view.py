"""The view of one or many avatars: takes messages, writes Rerun."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Self
from uuid import uuid4

import rerun as rr

from arm_ik_service.errors import ViewError
from arm_ik_service.io.rerun_view.blueprint import blueprint_of
from arm_ik_service.io.rerun_view.entities import Sender, entity_of, log_name, log_styles, skeleton_of
from arm_ik_service.io.rerun_view.overlays import LEGEND as OVERLAY_LEGEND
from arm_ik_service.io.rerun_view.overlays import ComfortOf, Overlay
from arm_ik_service.io.rerun_view.props import Box, Legs
from arm_ik_service.io.rerun_view.rows import Rows
from arm_ik_service.io.rerun_view.sinks import Save, Sink, attach, first_line
from arm_ik_service.io.rerun_view.skinned import Skin
from arm_ik_service.wire.messages import ArmsState, ControllerFrame, Pose, Skeleton, Vector

APPLICATION = "arm_ik"
CLOSE_WITHIN_S = 5.0
BATCH_ROWS = 512  # offline: rows gathered before they are sent; a call then costs nothing a row
ROW = 5  # people beside each other
LEGEND = """\
**Sleeves, plots**: left blue, right orange. **Dark red**: beyond a joint's range. **White controller**: the pose \
asked for; **red line**: from the hand to it. **Hands**: tracked green, inferred yellow, held pink, lost grey. \
**Latency**: network blue, solve violet, total white."""


@dataclass
class _Person:
    root: str
    sender: Sender
    chest: Pose
    rows: Rows = field(default_factory=Rows)


class RerunView:
    """Logs what is added to one or several sinks. One thread at a time.

    >>> with RerunView(Save(Path("session.rrd"))) as view:
    ...     view.describe(skeleton)
    ...     view.add(arms, frame)

    Timelines: `frame` (seq) and `sample_time` (duration). Nothing is sent before `flush`, `close`, or BATCH_ROWS rows.
    """

    def __init__(
        self,
        *sinks: Sink,
        name: str = "",
        spacing_m: float = 0.0,
        skin: Skin | None = None,
        show: frozenset[Overlay] = frozenset(),
        comfort: ComfortOf | None = None,
    ) -> None:
        """Open the sinks; `name` titles the recording, `spacing_m` sets avatars apart that share one origin.

        With a `skin` everybody is drawn as that character; without, as solids. `show` adds what explains the arms;
        `comfort` tells where elbows would be comfortable, which "swivel" then marks.

        Raises ViewError.
        """
        self._recording = rr.RecordingStream(APPLICATION, recording_id=uuid4(), send_properties=True)
        attach(self._recording, sinks)
        self.watched = not all(isinstance(sink, Save) for sink in sinks)  # somebody looks on
        self._spacing_m = spacing_m
        self._skin = skin
        self._show = show
        self._comfort = comfort
        self._people: dict[str, _Person] = {}
        self._boxes: list[Box] = []
        self._legs: list[Legs] = []
        self._stage: list[Vector] = []
        self._whole = skin is not None and not skin.arms_only  # people are seen down to their feet
        self._described: dict[str, Skeleton] = {}
        if name:
            self._recording.send_recording_name(name)
        legend = " ".join([LEGEND, *(text for overlay, text in OVERLAY_LEGEND.items() if overlay in show)])
        self._recording.log("/", rr.ViewCoordinates.RIGHT_HAND_Y_UP, static=True)
        self._recording.log("/legend", rr.TextDocument(legend, media_type=rr.MediaType.MARKDOWN), static=True)

    def describe(self, skeleton: Skeleton) -> None:
        """Take in what does not change of an avatar: lengths, joint limits, grips. Again where that did change.

        An avatar that was never described has its lengths measured from its first message, and no limits in its plots.
        """
        self._described[skeleton.avatar] = skeleton
        if (person := self._people.get(skeleton.avatar)) is not None:
            self._send(person)
            person.sender.describe(skeleton)

    def add(self, arms: ArmsState, frame: ControllerFrame | None) -> None:
        """Gather one answer and the frame it answers (None where that was missed: no target is drawn)."""
        person = self._people.get(arms.avatar) or self._meet(arms)
        person.rows.add(frame, arms)
        if len(person.rows) >= BATCH_ROWS:
            self._send(person)

    def box(self, name: str, edge_m: float) -> Box:
        """Put a cube beside the people; it is moved by what is added to it."""
        self._boxes.append(Box(self._recording, name, edge_m))
        return self._boxes[-1]

    def legs(self, avatar: str) -> Legs | None:
        """Give an avatar legs, moved by what is added to them; None where it is drawn as somebody who has some."""
        if self._skin is not None and not self._skin.arms_only:
            return None
        self._whole = True
        self._legs.append(Legs(self._recording, f"{entity_of(avatar)}/legs"))
        return self._legs[-1]

    def stage(self, places: Iterable[Vector]) -> None:
        """Say where something is going to happen, from where somebody begins on: the eye will see all of it."""
        self._stage = list(places)

    def flush(self) -> None:
        """Send what was gathered. Does not wait for the viewer; what it has not taken yet waits in memory."""
        for person in self._people.values():
            self._send(person)
        for box in self._boxes:
            box.flush()
        for legs in self._legs:
            legs.flush()

    def settled(self, timeout_s: float) -> bool:
        """Wait until the file or the viewer has taken everything that was sent, or the time is over.

        Raises ViewError where it never will: the viewer was closed, the disk is full.
        """
        try:
            self._recording.flush(timeout_sec=timeout_s)
        except RuntimeError as error:
            if "timed out" in str(error):
                return False
            raise ViewError(f"the view ends here, its viewer or file is gone: {first_line(error)}") from error
        return True

    def close(self) -> None:
        """Send the rest, finish the file and let go of the viewer. Raises ViewError where the rest was not taken."""
        self.flush()
        if not self.settled(CLOSE_WITHIN_S):
            _abandon(self._recording)
            raise ViewError(
                f"the viewer did not take the last of the view within {CLOSE_WITHIN_S:.0f} s: does it hang?"
            )
        self._recording.disconnect()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _send(self, person: _Person) -> None:
        rows, person.rows = person.rows, Rows()
        person.sender.send(rows)

    def _followed(self, root: str) -> str | None:
        """Entity that the eye goes along with: the only person's middle.

        Not while somebody looks on: a viewer that is told to follow what it sees already goes up close to it.
        """
        if len(self._people) > 1 or self.watched:
            return None
        return f"{root}/legs/right/thigh" if self._legs else f"{root}/chest"

    def _meet(self, arms: ArmsState) -> _Person:
        """Log everything static of an avatar that is seen for the first time, and lay the viewer out anew."""
        root = entity_of(arms.avatar)
        person = _Person(root, Sender(self._recording, root, self._skin, self._show, self._comfort), arms.chest)
        aside, behind = _place(len(self._people), self._spacing_m)
        if aside or behind:
            self._recording.log(root, rr.Transform3D(translation=(aside, 0.0, behind)), static=True)
            x, y, z = arms.chest.position
            person.chest = Pose((x + aside, y, z + behind), arms.chest.orientation)
        self._people[arms.avatar] = person
        log_styles(self._recording, root)
        person.sender.describe(self._described.get(arms.avatar) or skeleton_of(arms))
        if len(self._people) > 1:
            for name, one in self._people.items():
                log_name(self._recording, one.root, name)
        roots = {name: one.root for name, one in self._people.items()}
        chests = [one.chest for one in self._people.values()]
        layout = blueprint_of(roots, chests, self._followed(root), whole=self._whole, stage=self._stage)
        self._recording.send_blueprint(layout)
        return person


def _place(index: int, spacing_m: float) -> tuple[float, float]:
    """Where the next person stands, x and z [m]: in rows as for a group picture, each between two of those in front."""
    row, column = divmod(index, ROW)
    return spacing_m * (column + 0.5 * (row % 2)), spacing_m * row


def _abandon(recording: rr.RecordingStream) -> None:
    """Leave a stream whose viewer hangs: to disconnect it, or to let it be collected at exit, would wait for ever."""
    for one in (recording, recording.to_native()):
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(one))
    rr.unregister_shutdown()


def write_recording(
    path: Path,
    answers: Iterable[tuple[ControllerFrame | None, ArmsState]],
    skeleton: Skeleton | None = None,
    *,
    name: str = "",
    skin: Skin | None = None,
) -> int:
    """Write a solved session to an .rrd, in constant memory; returns the number of frames. Raises ViewError."""
    count = 0
    with RerunView(Save(path), name=name, skin=skin) as view:
        if skeleton is not None:
            view.describe(skeleton)
        for frame, arms in answers:
            view.add(arms, frame)
            count += 1
    return count
