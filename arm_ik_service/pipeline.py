"""The one place where the stages are chained: tracking, body, both arms, and what the arms ask of the trunk.

Nothing here knows the time, the network or the disk.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from arm_ik_service.arm.model import ArmModel
from arm_ik_service.body.grip import learn_grip
from arm_ik_service.body.profile import Profile
from arm_ik_service.body.state import BODY
from arm_ik_service.body.step import initialise_body, step_body
from arm_ik_service.body.trunk import give_way
from arm_ik_service.compiled import Record, compiled, record_dtype
from arm_ik_service.ik.state import ARM
from arm_ik_service.ik.step import initialise_arm, show_ahead, step_arm
from arm_ik_service.settings import BodySettings, Settings, SolverSettings, TrackingSettings, section_dtype, to_record
from arm_ik_service.tracking.state import TRACKING
from arm_ik_service.tracking.step import ACCEPTED, initialise_tracking, step_tracking
from arm_ik_service.wire.messages import SIDES

PERSON = record_dtype([("tracking", TRACKING), ("body", BODY), ("arms", ARM, (2,))])
SETTINGS = record_dtype(
    [
        ("tracking", section_dtype(TrackingSettings)),
        ("body", section_dtype(BodySettings)),
        ("solver", section_dtype(SolverSettings)),
    ]
)


def settings_record(settings: Settings) -> np.ndarray[tuple[int], np.dtype[np.void]]:
    """Return a SETTINGS record (1,)."""
    record = np.zeros(1, SETTINGS)
    record["tracking"], record["body"] = to_record(settings.tracking), to_record(settings.body)
    record["solver"] = to_record(settings.solver)
    return record


def arm_models(profile: Profile) -> tuple[ArmModel, ArmModel]:
    """Return the left and the right arm of a person. Raises ModelError or ProfileError."""
    body = profile.body
    left, right = (
        ArmModel.load(
            side=side,
            upper_arm_m=body.upper_arm,
            forearm_m=body.forearm,
            hand_m=body.hand,
            limits=profile.limits_deg.in_radians(),
        )
        for side in SIDES
    )
    return left, right


def initialise_person(person: Record, profile: Profile, models: Iterable[ArmModel]) -> None:
    """Set a PERSON record to someone of this profile at rest, who has these arms."""
    initialise_tracking(person.tracking)
    initialise_body(person.body, profile)
    for side, model in enumerate(models):
        initialise_arm(person.arms[side], model)


@compiled
def step_person(person: Record, frame: Record, receive_time_ns: int, ahead_s: float, settings: Record) -> int:
    """Run every stage for one FRAME record; the verdict of tracking: nothing has changed unless it is ACCEPTED."""
    tracking, body = person.tracking, person.body
    verdict = step_tracking(tracking, frame, receive_time_ns, settings.tracking)
    if verdict != ACCEPTED:
        return int(verdict)
    step_body(body, tracking, settings.body)
    for side in range(2):
        arm = person.arms[side]
        if body.learning.arms:  # nobody measured this person: their arms are as long as they turn out to be
            arm.chain.upper_arm_m, arm.chain.forearm_m = body.upper_arm, body.forearm
        step_arm(arm, body.targets[side], tracking.dt_s, settings.solver)
        if ahead_s > 0.0:
            show_ahead(arm, ahead_s)
    give_way(body, tracking, person.arms, tracking.interval_s)
    if settings.body.learns:
        learn_grip(body, tracking, person.arms, tracking.interval_s)
    return int(verdict)
