"""The one place where the stages are chained: tracking, body, both arms, output; for many avatars or for one.

All state of all avatars lives in one structured array, a row each. Nothing here knows the time, the network or the
disk: the same frames with the same receive times give the same bytes, live or replayed.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from arm_ik_service.arm.model import ArmModel
from arm_ik_service.body.profile import Profile
from arm_ik_service.body.state import BODY
from arm_ik_service.body.step import initialise_body, step_body
from arm_ik_service.compiled import Record, compiled, record_dtype
from arm_ik_service.ik.state import ARM
from arm_ik_service.ik.step import initialise_arm, show_ahead, step_arm
from arm_ik_service.output import OUTPUT, read_output, write_output
from arm_ik_service.settings import Settings, to_record
from arm_ik_service.tracking.frame import FRAME, pack_frame
from arm_ik_service.tracking.state import TRACKING
from arm_ik_service.tracking.step import ACCEPTED, initialise_tracking, step_tracking
from arm_ik_service.wire.messages import SIDES, ArmsState, ControllerFrame

AVATAR = record_dtype([("tracking", TRACKING), ("body", BODY), ("arms", ARM, (2,))])


@compiled
def step_batch(
    rows: Any,
    outputs: Any,
    indices: Any,
    frames: Any,
    receive_times_ns: Any,
    ahead_s: Any,
    verdicts: Any,
    count: int,
    tracking_settings: Record,
    body_settings: Record,
    solver_settings: Record,
) -> None:
    """Run every stage for `count` frames in order: frame k is of the avatar in row `indices[k]` and fills output k."""
    for k in range(count):
        row = rows[indices[k]]
        verdicts[k] = step_tracking(row.tracking, frames[k], receive_times_ns[k], tracking_settings)
        if verdicts[k] != ACCEPTED:
            continue
        step_body(row.body, row.tracking, body_settings)
        for side in range(2):
            arm = row.arms[side]
            if row.body.learning.arms:  # nobody measured this person: their arms are as long as they turn out to be
                arm.chain.upper_arm_m, arm.chain.forearm_m = row.body.upper_arm, row.body.forearm
            step_arm(arm, row.body.targets[side], row.tracking.dt_s, solver_settings)
            if ahead_s[k] > 0.0:
                show_ahead(arm, ahead_s[k])
        write_output(outputs[k], row.tracking, row.body, row.arms)


class Avatars:
    """Rows for `capacity` avatars and a batch of up to `batch` frames of any of them, all allocated once."""

    def __init__(self, settings: Settings | None = None, *, capacity: int = 1, batch: int = 1) -> None:
        settings = settings or Settings()
        self._rows = np.zeros(capacity, AVATAR)
        self._frames = np.zeros(batch, FRAME)
        self._indices = np.zeros(batch, np.int64)
        self._receive_times_ns = np.zeros(batch, np.int64)
        self._ahead_s = np.zeros(batch)
        self._outputs = np.zeros(batch, OUTPUT)
        self._predict_s = settings.solver.predict_s
        self.verdicts = np.zeros(batch, np.int64)
        self._settings = (to_record(settings.tracking), to_record(settings.body), to_record(settings.solver))
        self._models: dict[Profile, tuple[ArmModel, ArmModel]] = {}
        self.count = 0

    def reserve(self, capacity: int) -> None:
        """Make room for at least `capacity` avatars; those there keep their state."""
        missing = capacity - len(self._rows)
        if missing > 0:
            self._rows = np.concatenate([self._rows, np.zeros(missing, AVATAR)])

    def reset(self, index: int, profile: Profile) -> None:
        """Make row `index` a person of this profile at rest. Raises ModelError or ProfileError."""
        row = self._rows[index]
        initialise_tracking(row.tracking)
        initialise_body(row.body, profile)
        for side, model in enumerate(self._arms(profile)):
            initialise_arm(row.arms[side], model)

    def resume(self, index: int, state: ArmsState) -> bool:
        """Let the person in row `index`, at rest until now, go on from an answer that another process published.

        The elbows stay where they were and the chest looks where it looked. An answer with a number that no arm has is
        not used: returns whether it was.
        """
        row = self._rows[index]
        configurations = [np.array(arm.configuration, np.float64) for arm in (state.left, state.right)]
        for q in configurations:
            if q.shape != (10,) or not np.isfinite(q).all() or abs(np.linalg.norm(q[:4]) - 1.0) > 1e-3:
                return False
            if np.abs(q[4:]).max() > np.pi:
                return False
        for arm, q in zip(row.arms, configurations, strict=True):
            arm["configuration"] = q
            arm["before"] = q
            arm["started"] = 1  # not a first frame: it would choose the elbow afresh
        return True

    def _arms(self, profile: Profile) -> tuple[ArmModel, ArmModel]:
        models = self._models.get(profile)
        if models is None:
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
            models = self._models[profile] = (left, right)
        return models

    def add(self, index: int, frame: ControllerFrame, receive_time_ns: int, predict_to_ns: int | None = None) -> int:
        """Put a frame of the avatar in row `index` at the end of the batch; returns its place there.

        `predict_to_ns`, on the clock of the sample time, asks for the arms as they will be then; None takes what the
        settings say, which is no prediction unless they do.
        """
        place = self.count
        self._ahead_s[place] = (
            self._predict_s if predict_to_ns is None else 1e-9 * (predict_to_ns - frame.sample_time_ns)
        )
        pack_frame(frame, self._frames, place)
        self._indices[place] = index
        self._receive_times_ns[place] = receive_time_ns
        self.count = place + 1
        return place

    def step(self) -> None:
        """Solve the batch and empty it; `verdicts[place]` says what became of each frame."""
        step_batch(
            self._rows,
            self._outputs,
            self._indices,
            self._frames,
            self._receive_times_ns,
            self._ahead_s,
            self.verdicts,
            self.count,
            *self._settings,
        )
        self.count = 0

    def answer(
        self,
        place: int,
        frame: ControllerFrame,
        avatar: str,
        receive_time_ns: int,
        solve_time_ns: int = 0,
        publish_time_ns: int = 0,
    ) -> ArmsState:
        """Return the message that answers the accepted frame at `place` of the last batch."""
        return read_output(
            self._outputs,
            place,
            avatar=avatar,
            seq=frame.seq,
            sample_time_ns=frame.sample_time_ns,
            receive_time_ns=receive_time_ns,
            solve_time_ns=solve_time_ns,
            publish_time_ns=publish_time_ns,
        )


class Avatar:
    """One person.

    >>> avatar = Avatar()
    >>> state = avatar.step(frame, now_ns=frame.sample_time_ns)
    >>> state.left.bones.forearm.position  # the elbow in world axes [m]
    """

    def __init__(
        self, profile: Profile | None = None, settings: Settings | None = None, *, name: str = "avatar"
    ) -> None:
        """Raises ModelError or ProfileError where no arm can be built from the profile."""
        self.name = name
        self._avatars = Avatars(settings)
        self._avatars.reset(0, profile or Profile())

    def step(self, frame: ControllerFrame, now_ns: int, predict_to_ns: int | None = None) -> ArmsState | None:
        """Solve both arms for one frame received at `now_ns`; None where the frame is refused (late or repeated).

        `predict_to_ns`, on the clock of the sample time and at most 0.1 s after it, moves the arms on by their joint
        velocities to that time; chest and shoulders stay, and the residual holds the way that was added. The two times
        that only a service can measure, solving and publishing, are 0 in the message.
        """
        avatars = self._avatars
        avatars.add(0, frame, now_ns, predict_to_ns)
        avatars.step()
        if avatars.verdicts[0] != ACCEPTED:
            return None
        return avatars.answer(0, frame, self.name, now_ns)
