"""What a recording is like, and how well it solves: the numbers behind `arm-ik check`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from arm_ik_service.arm.model import LIMITS
from arm_ik_service.body.profile import Profile
from arm_ik_service.body.report import ArmReport, report_arm
from arm_ik_service.errors import SessionError
from arm_ik_service.io.session import RecordedFrame, Session, require_avatar
from arm_ik_service.programs.calibrator import as_records
from arm_ik_service.programs.offline import receive_times, solve_frames
from arm_ik_service.settings import Settings
from arm_ik_service.tracking.report import SessionReport, report_session
from arm_ik_service.wire.messages import SIDES, ArmsState, Side


@dataclass(frozen=True)
class PersonReport:
    """One avatar of a recording."""

    avatar: str
    devices: SessionReport
    arms: dict[Side, ArmReport]


def check_avatar(
    session: Session,
    avatar: str,
    profiles: Mapping[str, Profile],
    settings: Settings,
    *,
    progress: Callable[[int], None] | None = None,
    also: Callable[[RecordedFrame, ArmsState], None] | None = None,
) -> PersonReport:
    """Report on one avatar's frames; `also` is given every answer. Raises SessionError where there are none."""
    require_avatar(session, avatar)
    timed = list(receive_times(recorded for recorded in session.frames() if recorded.avatar == avatar))
    if not timed:
        raise SessionError(f"{session.path}: no frame of {avatar!r} in it; it has {', '.join(session.avatars)}")
    records = as_records(recorded.frame for recorded, _ in timed)
    times_ns = np.array([time_ns for _, time_ns in timed], np.int64)
    columns: dict[Side, list[tuple[Any, ...]]] = {side: [] for side in SIDES}
    times_s = []
    for recorded, state in solve_frames((recorded for recorded, _ in timed), profiles, settings, progress):
        times_s.append(state.sample_time_ns * 1e-9)
        for side, arm in zip(SIDES, (state.left, state.right), strict=True):
            mask = sum(1 << LIMITS.index(name) for name in arm.limits)
            columns[side].append(
                (
                    arm.bones.forearm.position,
                    arm.bones.hand.position,
                    arm.position_error_m,
                    arm.orientation_error_rad,
                    arm.reach_ratio,
                    arm.iterations,
                    mask,
                )
            )
        if also is not None:
            also(recorded, state)
    arms = {side: _report(np.array(times_s), columns[side]) for side in SIDES}
    return PersonReport(avatar, report_session(records, times_ns, settings.tracking), arms)


def _report(t_s: Any, rows: list[tuple[Any, ...]]) -> ArmReport:
    elbow, hand, position, orientation, reach, iterations, limits = (np.array(c) for c in zip(*rows, strict=True))
    return report_arm(
        t_s,
        elbow=elbow,
        hand=hand,
        position_error_m=position,
        orientation_error_rad=orientation,
        reach_ratio=reach,
        iterations=iterations,
        limits=limits,
        limit_names=LIMITS,
    )
