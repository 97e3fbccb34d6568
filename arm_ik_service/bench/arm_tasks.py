"""What the solvers are measured on: one arm of one person along one recording.

From a motion-capture session the task is the truth: the recorded shoulder, wrist and wrist rotation, the recorded bone
lengths, and the recorded elbow to compare with. From any other session it is what the pipeline asks of its arms, and no
elbow is known.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from arm_ik_service.arm.model import ArmModel
from arm_ik_service.body.state import BODY
from arm_ik_service.body.step import initialise_body, step_body
from arm_ik_service.errors import SessionError
from arm_ik_service.geometry import batch
from arm_ik_service.io.columns import Archive
from arm_ik_service.io.session import NPZ_MAGIC, open_session
from arm_ik_service.programs.offline import profiles_for, receive_times
from arm_ik_service.settings import Settings, to_record
from arm_ik_service.tracking.frame import FRAME, pack_frame
from arm_ik_service.tracking.state import ACCEPTED, TRACKING
from arm_ik_service.tracking.step import initialise_tracking, step_tracking
from arm_ik_service.wire.messages import SIDES, Side

Array = npt.NDArray[np.float64]

TRUTH = tuple(f"{side}_{name}" for side in SIDES for name in ("shoulder", "elbow", "wrist", "wrist_q"))


class ArmTask(NamedTuple):
    """One arm along N targets."""

    session: str
    side: Side
    rate_hz: float  # median
    arm: ArmModel
    targets: Array  # (N, 7) shoulder_from_hand, of this side
    elbow: Array | None  # (N, 3) recorded, in the shoulder frame [m]
    shoulder: Array  # (N, 7) world_from_shoulder: where to draw it

    @property
    def name(self) -> str:
        """Session and side."""
        return f"{self.session} {self.side}"


def read_tasks(path: Path, frames: int) -> list[ArmTask]:
    """Read both arms of a session, at most `frames` consecutive frames from its middle. Raises SessionError."""
    session = open_session(path)
    with path.open("rb") as file:
        is_archive = file.read(len(NPZ_MAGIC)) == NPZ_MAGIC
    if is_archive:
        with Archive(path) as archive:
            if all(name in archive for name in TRUTH):
                return list(_recorded(path.stem, archive, frames))
    count = session.frame_count
    start = max(0, (count - frames) // 2) if count is not None else 0
    return _asked_for(path, start, frames)


def _rate_hz(times_s: Array) -> float:
    return float(1.0 / max(float(np.median(np.diff(times_s))), 1e-6)) if len(times_s) > 1 else 90.0


def _recorded(name: str, archive: Archive, frames: int) -> Iterator[ArmTask]:
    """Targets from true shoulders and wrists. The chest's axes: along the line between the shoulders, and upright."""
    columns = {column: archive.column(column) for column in ("t", *TRUTH)}
    length = columns["t"].shape[0]
    start = max(0, (length - frames) // 2)
    rows = {c: np.asarray(column.take(length)[start : start + frames], float) for c, column in columns.items()}
    right = (rows["right_shoulder"] - rows["left_shoulder"]) * (1.0, 0.0, 1.0)
    right = batch.normalized(right)
    up = np.broadcast_to((0.0, 1.0, 0.0), right.shape)
    world_from_chest = batch.from_matrix(np.stack([right, up, np.cross(right, up)], axis=-1))
    chest_from_world = batch.conjugate(world_from_chest)
    for side in SIDES:
        shoulder, elbow, wrist, rotation = (rows[f"{side}_{c}"] for c in ("shoulder", "elbow", "wrist", "wrist_q"))
        elbow = batch.rotate(chest_from_world, elbow - shoulder)
        wrist = batch.rotate(chest_from_world, wrist - shoulder)
        hand = batch.multiply(chest_from_world, batch.normalized(rotation))
        yield ArmTask(
            session=name,
            side=side,
            rate_hz=_rate_hz(rows["t"]),
            arm=ArmModel.load(
                side,
                upper_arm_m=float(np.linalg.norm(elbow, axis=1).mean()),
                forearm_m=float(np.linalg.norm(wrist - elbow, axis=1).mean()),
            ),
            targets=np.concatenate([wrist, hand], axis=1),
            elbow=elbow,
            shoulder=np.concatenate([shoulder, world_from_chest], axis=1),
        )


def _asked_for(path: Path, start: int, frames: int) -> list[ArmTask]:
    """Run tracking and body over the session and keep what they ask of the arms."""
    session = open_session(path)
    settings = Settings()
    packed, tracking, body = np.zeros(1, FRAME), np.zeros(1, TRACKING), np.zeros(1, BODY)
    initialise_tracking(tracking[0])
    avatar = session.avatars[0]
    profile = profiles_for(session)[avatar]
    initialise_body(body[0], profile)
    tracking_settings, body_settings = to_record(settings.tracking), to_record(settings.body)
    times_s, targets, shoulders = [], [], []
    stream = receive_times(recorded for recorded in session.frames() if recorded.avatar == avatar)
    for recorded, now_ns in islice(stream, start + frames):
        pack_frame(recorded.frame, packed.view(np.uint8).data)
        if step_tracking(tracking[0], packed[0], now_ns, tracking_settings) != ACCEPTED:
            continue
        step_body(body[0], tracking[0], body_settings)
        times_s.append(1e-9 * recorded.frame.sample_time_ns)
        targets.append([np.concatenate([target.position, target.rotation]) for target in body[0].targets])
        shoulders.append([np.concatenate([place, body[0].chest_rotation]) for place in body[0].shoulders])
    kept = slice(max(0, len(targets) - frames), None)
    if not targets:
        raise SessionError(f"{path}: no frame of this session can be solved")
    measures = profile.body
    return [
        ArmTask(
            session=path.stem,
            side=side,
            rate_hz=_rate_hz(np.array(times_s[kept])),
            arm=ArmModel.load(side, measures.upper_arm, measures.forearm, measures.hand),
            targets=np.array(targets[kept])[:, k],
            elbow=None,
            shoulder=np.array(shoulders[kept])[:, k],
        )
        for k, side in enumerate(SIDES)
    ]
