"""People solved frame by frame: many avatars in one process, or one.

All state of all avatars lives in one structured array, a row each. Nothing here knows the time, the network or the
disk: the same frames with the same receive times give the same bytes, live or replayed.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np

from arm_ik_service.arm.model import ArmModel
from arm_ik_service.body.learning import resume_learning
from arm_ik_service.body.profile import BodyMeasures, Profile
from arm_ik_service.body.shoulders import STERNOCLAVICULAR
from arm_ik_service.compiled import compiled, record_dtype
from arm_ik_service.geometry.batch import Array
from arm_ik_service.output.message import BODY_BYTES, LITERALS, STEPS, write_body
from arm_ik_service.output.record import OUTPUT, write_output
from arm_ik_service.pipeline import PERSON, SETTINGS, arm_models, initialise_person, settings_record, step_person
from arm_ik_service.settings import Settings
from arm_ik_service.tracking.frame import FRAME, pack_frame
from arm_ik_service.tracking.step import ACCEPTED
from arm_ik_service.wire import codec
from arm_ik_service.wire.messages import VERSION, ArmsHeader, ArmsState, ControllerFrame, Encoding

TASK = record_dtype(
    [
        ("row", np.int64),  # of the avatar
        ("receive_time_ns", np.int64),
        ("ahead_s", np.float64),  # how far to predict
        ("frame", FRAME),
        ("verdict", np.int64),
        ("body_bytes", np.int64),  # length of the message's body
    ]
)
_TASK_HEAD = struct.Struct("=2qd")


@compiled
def step_batch(
    rows_memory: Any,
    tasks_memory: Any,
    outputs_memory: Any,
    bodies: Any,
    settings_memory: Any,
    literals: Any,
    steps: Any,
    count: int,
) -> None:
    """Solve and write out the first `count` tasks in order: task k is of the avatar in its row and fills body k.

    Records come as memory without a structure, uint8 or int64: to tell numba the type of an array of records takes
    longer than to solve for it.
    """
    rows, tasks, outputs = rows_memory.view(PERSON), tasks_memory.view(TASK), outputs_memory.view(OUTPUT)
    settings = settings_memory.view(SETTINGS)[0]
    numbers = len(outputs_memory) // len(outputs)
    for k in range(count):
        task = tasks[k]
        row = rows[task.row]
        task.verdict = step_person(row, task.frame, task.receive_time_ns, task.ahead_s, settings)
        if task.verdict != ACCEPTED:
            continue
        write_output(outputs[k], row.tracking, row.body, row.arms)
        task.body_bytes = write_body(outputs_memory[k * numbers : (k + 1) * numbers], literals, steps, bodies[k])


class Avatars:
    """Rows for `capacity` avatars and a batch of up to `batch` frames of any of them, all allocated once."""

    def __init__(self, settings: Settings | None = None, *, capacity: int = 1, batch: int = 1) -> None:
        settings = settings or Settings()
        self._rows = np.zeros(capacity, PERSON)
        self._memory = self._rows.view(np.uint8)
        tasks = np.zeros(batch, TASK)
        self.verdicts = tasks["verdict"]
        self._body_bytes = tasks["body_bytes"]
        bodies = np.zeros((batch, BODY_BYTES), np.uint8)
        self._bodies = [body.data for body in bodies]
        of = settings_record(settings)
        self._tasks = tasks.view(np.uint8)
        self._tasks_buffer = self._tasks.data
        self._rest = (np.zeros(batch, OUTPUT).view(np.int64), bodies, of.view(np.uint8), LITERALS, STEPS)
        self._predict_s = settings.solver.predict_s
        self._models: dict[Profile, tuple[ArmModel, ArmModel]] = {}
        self.count = 0

    def reserve(self, capacity: int) -> None:
        """Make room for at least `capacity` avatars; those there keep their state."""
        missing = capacity - len(self._rows)
        if missing > 0:
            self._rows = np.concatenate([self._rows, np.zeros(missing, PERSON)])
            self._memory = self._rows.view(np.uint8)

    def reset(self, index: int, profile: Profile) -> None:
        """Make row `index` a person of this profile at rest. Raises ModelError or ProfileError, the row as it was."""
        models = self._models.get(profile)
        if models is None:
            models = self._models[profile] = arm_models(profile)
        initialise_person(self._rows[index], profile, models)

    def copy(self, source: int, target: int) -> None:
        """Make row `target` the person in row `source`, as they are now."""
        self._rows[target] = self._rows[source]

    def resume(self, index: int, state: ArmsState) -> bool:
        """Let the person in row `index`, at rest until now, go on from an answer that another process published.

        The elbows stay where they were, and lengths that were being learnt go on from what they were. An answer with a
        number that no arm has is not used: returns whether it was.
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
            arm["shown"] = q
            arm["started"] = 1  # not a first frame: it would choose the elbow afresh
        left, right = state.left.bones, state.right.bones
        resume_learning(
            row.body,
            math.dist(right.upper_arm.position, right.forearm.position),
            math.dist(right.forearm.position, right.hand.position),
            0.5 * math.dist(left.clavicle.position, right.clavicle.position) / STERNOCLAVICULAR[0],
        )
        return True

    def measures(self, index: int, profile: Profile) -> BodyMeasures:
        """Return the lengths that the person in row `index` is solved with: of their profile, or learnt so far."""
        body = self._rows[index]["body"]
        return BodyMeasures(
            stature_m=float(body["stature"]),
            upper_arm_m=float(body["upper_arm"]),
            forearm_m=float(body["forearm"]),
            hand_m=profile.body.hand_m,
            shoulder_width_m=2.0 * float(body["half_width"]),
        )

    def lengths(self, indices: Sequence[int]) -> Array:
        """Return stature, upper arm, forearm and half the shoulders' width (N, 4) of the people in these rows [m]."""
        body = self._rows["body"]
        return np.stack([body[name][indices] for name in ("stature", "upper_arm", "forearm", "half_width")], axis=-1)

    def grip_turn(self, index: int) -> Array:
        """Return how far the right hand of the person in row `index` was found to be turned on its controller.

        A rotation vector (3,) [rad] in the wrist frame that the profile says; the left hand's is its mirror image.
        """
        return np.array(self._rows[index]["body"]["grip"]["turn"])

    def add(self, index: int, frame: ControllerFrame, receive_time_ns: int, predict_to_ns: int | None = None) -> int:
        """Put a frame of the avatar in row `index` at the end of the batch; returns its place there.

        `predict_to_ns`, on the clock of the sample time, asks for the arms as they will be then; None takes what the
        settings say, which is no prediction unless they do.
        """
        place = self.count
        ahead_s = self._predict_s if predict_to_ns is None else 1e-9 * (predict_to_ns - frame.sample_time_ns)
        at = place * TASK.itemsize
        _TASK_HEAD.pack_into(self._tasks_buffer, at, index, receive_time_ns, ahead_s)
        pack_frame(frame, self._tasks_buffer, at + _TASK_HEAD.size)
        self.count = place + 1
        return place

    def step(self) -> None:
        """Solve the batch and empty it; `verdicts[place]` says what became of each frame."""
        step_batch(self._memory, self._tasks, *self._rest, self.count)
        self.count = 0

    def payload(
        self,
        place: int,
        frame: ControllerFrame,
        avatar: str,
        receive_time_ns: int,
        solve_time_ns: int = 0,
        publish_time_ns: int = 0,
        encoding: Encoding = "msgpack",
    ) -> bytes:
        """Return the encoded ArmsState that answers the accepted frame at `place` of the last batch."""
        header = ArmsHeader(
            VERSION, avatar, frame.seq, frame.sample_time_ns, receive_time_ns, solve_time_ns, publish_time_ns
        )
        payload = codec.join(header, self._bodies[place][: self._body_bytes[place]])
        return payload if encoding == "msgpack" else codec.encode(codec.arms_states.decode(payload), encoding)

    def answer(self, place: int, frame: ControllerFrame, avatar: str, receive_time_ns: int) -> ArmsState:
        """Return the same as an object, its solve and publish times 0."""
        return codec.arms_states.decode(self.payload(place, frame, avatar, receive_time_ns))


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
