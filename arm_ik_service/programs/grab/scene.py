"""What happens: the person walks to the cube, takes it, carries it to the goal if there is one, and lets it go there.

The hand follows one rule throughout: from where it was when the stage began it goes over, along a minimum-jerk course,
into what the stage wants, which may move. So walking blends out into reaching, and a cube that is put elsewhere is
followed at any time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from arm_ik_service.body.profile import Profile
from arm_ik_service.geometry import batch
from arm_ik_service.ik.registry import DEFAULT, SolverChoice
from arm_ik_service.io.synthesis.motion import minimum_jerk
from arm_ik_service.programs.grab.figure import Figure, Trunk, about
from arm_ik_service.programs.grab.helpers import PRIORITY, recruit
from arm_ik_service.programs.grab.legs import legs
from arm_ik_service.programs.grab.walk import Walker, cycle
from arm_ik_service.wire.messages import ArmsState, ControllerFrame, Side

Floats = npt.NDArray[np.float64]
Stage = Literal["walk", "reach", "carry", "place", "leave", "done"]

RATE_HZ = 90.0
CUBE_M = 0.07  # edge
IN_RANGE_M = 0.95  # of the cube, along the floor: from here on the hand goes for it ...
OUT_OF_RANGE_M = 1.15  # ... and from here on it gives up
STANDOFF_M = 0.45
COMFORTABLE_REACH = 0.93  # of the arm's length; beyond it the helpers are asked
DURATION_S: dict[Stage, float] = {"walk": 0.7, "reach": 1.1, "carry": 0.9, "place": 1.1, "leave": 0.9, "done": 1.0}
HELP_TIME_S = 0.08  # in which trunk and clavicle follow what is asked of them
GAZE_TIME_S = 0.35
GRASPED_M = 0.015  # of the hand from its target
PLACED_M = 0.003  # of the cube from its goal
PALM_FROM_WRIST = np.array([0.0, -0.02, -0.075])  # OpenXR wrist frame
CARRIED = {"right": np.array([0.12, -0.26, -0.30]), "left": np.array([-0.12, -0.26, -0.30])}  # wrist in the chest frame
GAZE_MOST = (math.radians(60.0), math.radians(55.0))


@dataclass(frozen=True)
class Moment:
    """One instant: what a headset would send, the arms, and the cube's centre with its axes (7,).

    `legs` (2,4,3) [m] are left and right: hip, knee, ankle, toe. They are for the picture: no message holds them.
    """

    frame: ControllerFrame
    arms: ArmsState
    cube: Floats
    legs: Floats
    stage: Stage
    help_given: dict[str, float]


@dataclass
class _Hand:
    side: Side = "right"
    start: Floats = field(default_factory=lambda: np.zeros(7))  # pose in the chest frame when the stage began
    now: Floats = field(default_factory=lambda: np.zeros(7))
    share: float = 1.0  # of the way over, in time


class Scene:
    """The scene, one `step` a frame. Pure: no clock, the same every time."""

    def __init__(
        self,
        cube: Floats,
        goal: Floats | None = None,
        *,
        profile: Profile | None = None,
        choice: SolverChoice | None = None,
        avatar: str = "grab",
        start: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Put the cube's centre at `cube` (3) [m] and the person at `start` (x, z), facing -z. Raises ModelError."""
        self.figure = Figure(profile or Profile(), choice or SolverChoice(DEFAULT, {}), avatar)
        self.cube = np.array([*cube, 0.0, 0.0, 0.0, 1.0])
        self.goal = None if goal is None else np.array(goal, float)
        self.stage: Stage = "walk"
        self._walker = Walker(np.array(start))
        self._help = np.zeros(len(PRIORITY))  # what is given now, when the stage began, and what is asked for
        self._help_before, self._asked = self._help, self._help
        self._advance = np.zeros(3)
        self._gaze = np.zeros(2)
        self._hand = _Hand()
        self._cube_in_hand: Floats | None = None
        self._held: Floats | None = None  # the hand as the solver left it
        self._seq = 0
        self._hand.start = self._hand.now = self._swing(self._hand.side)

    def move_cube(self, pose: Floats) -> None:
        """Put the cube elsewhere (7,), out of the hand too: the person goes after it."""
        self.cube = np.array(pose, float)
        self._cube_in_hand = None
        self._begin("walk")

    def moments(self, duration_s: float) -> Iterator[Moment]:
        """Step until the cube lies at its goal and the person stands, or the time is over."""
        for _ in range(round(duration_s * RATE_HZ)):
            yield self.step()
            if self.stage == "done" and self._hand.share >= 1.0:
                return

    def step(self) -> Moment:
        """Move on by one frame."""
        dt, hand = 1.0 / RATE_HZ, self._hand
        aim = self._aim()
        if self.stage not in ("leave", "done"):
            self._walker.step(aim[[0, 2]], STANDOFF_M, dt)
        hand.share = min(hand.share + dt / DURATION_S[self.stage], 1.0)
        chest = self._stand(dt)
        hand.now = _between(hand.start, self._wanted(chest), float(minimum_jerk(hand.share)))
        other: Side = "left" if hand.side == "right" else "right"
        hands = {hand.side: batch.compose(chest, hand.now), other: batch.compose(chest, self._swing(other))}
        advances = {hand.side: self._advance, other: np.zeros(3)}
        time_ns = round(self._seq * 1e9 / RATE_HZ)
        frame, arms = self.figure.pose(self._trunk(self._help), hands, advances, self._seq, time_ns, dt)
        self._seq += 1
        found = getattr(arms, hand.side)
        held = np.array([*found.bones.hand.position, *found.bones.hand.orientation])
        self._held = held
        if self._cube_in_hand is not None:
            self.cube = batch.compose(held, self._cube_in_hand)
        self._decide(held, found.position_error_m)
        given = dict(zip(PRIORITY, self._help.tolist(), strict=True))
        return Moment(frame, arms, self.cube.copy(), self._legs(), self.stage, given)

    def _aim(self) -> Floats:
        """Where the person is going (3)."""
        return self.goal if self.stage in ("carry", "place") and self.goal is not None else self.cube[:3]

    def _distance(self) -> float:
        return float(np.hypot(*(self._aim()[[0, 2]] - self._walker.place)))

    def _begin(self, stage: Stage) -> None:
        self._hand.start, self._hand.share, self.stage = self._hand.now.copy(), 0.0, stage
        self._help_before = self._help.copy()

    def _decide(self, held: Floats, error_m: float) -> None:
        """Go over to the next stage where this one has done its work."""
        arrived = self._hand.share >= 1.0 and error_m < GRASPED_M and self._walker.speed < 0.01
        if self.stage == "walk" and self._distance() < IN_RANGE_M:
            self._choose_hand()
            self._begin("reach")
        elif self.stage == "reach" and self._distance() > OUT_OF_RANGE_M:
            self._begin("walk")
        elif self.stage == "reach" and arrived:
            self._cube_in_hand = batch.compose(batch.inverse(held), self.cube)
            self._begin("carry")
        elif self.stage == "carry" and self.goal is not None and self._hand.share >= 1.0:
            if self._distance() < IN_RANGE_M:
                self._begin("place")
        elif self.stage == "place" and arrived and np.linalg.norm(self.cube[:3] - self._aim()) < PLACED_M:
            self._cube_in_hand = None
            self._begin("leave")
        elif self.stage == "leave" and self._hand.share >= 1.0:
            self._begin("done")

    def _choose_hand(self) -> None:
        """Take the hand on whose side the cube is; the other's present pose is where it starts."""
        chest = self.figure.chest(self._trunk(np.zeros(len(PRIORITY))))
        to_right = batch.compose(batch.inverse(chest), self.cube)[0]
        side: Side = "left" if to_right < -0.05 else "right"
        if side != self._hand.side:
            self._hand = _Hand(side, now=self._swing(side))

    def _trunk(self, given: Floats) -> Trunk:
        _, _, bob, yaw = cycle(self._walker.phase) * self._walker.stride
        sign = 1.0 if self._hand.side == "right" else -1.0  # turning to the left brings the right shoulder forward
        return Trunk(
            self._walker.place,
            self._walker.heading,
            turn=math.radians(yaw) + sign * given[1],
            lean=0.03 + given[2],
            height=bob - given[3],
            gaze=(float(self._gaze[0]), float(self._gaze[1])),
        )

    def _legs(self) -> Floats:
        walker, trunk = self._walker, self._trunk(self._help)
        stature = self.figure.profile.body.stature_m
        return legs(walker.place, walker.heading, trunk.height, stature, walker.phase, walker.stride)

    def _stand(self, dt: float) -> Floats:
        """Let clavicle, trunk and knees follow what the hand's target asks of them; returns the chest's pose (7,)."""
        side = self._hand.side
        target = self._reached_for()

        def advance(shoulder: Floats, amount: float) -> Floats:
            away = target[:3] - shoulder[:3]
            return np.asarray(amount * away / max(float(np.linalg.norm(away)), 1e-6))

        def shortfall(given: Floats) -> float:
            shoulder = self.figure.shoulder(self.figure.chest(self._trunk(given)), side)
            shoulder[:3] += advance(shoulder, given[0])
            return float(np.linalg.norm(target[:3] - shoulder[:3])) - COMFORTABLE_REACH * self.figure.arm_length

        wanted = recruit(shortfall) if self.stage in ("reach", "place") else np.zeros(len(PRIORITY))
        self._asked = self._asked + (1.0 - math.exp(-dt / HELP_TIME_S)) * (wanted - self._asked)
        over = float(minimum_jerk(self._hand.share))
        self._help = self._help_before + over * (self._asked - self._help_before)
        self._look(1.0 - math.exp(-dt / GAZE_TIME_S))
        chest = self.figure.chest(self._trunk(self._help))
        shoulder = self.figure.shoulder(chest, side)
        self._advance = advance(shoulder, float(self._help[0]))
        return chest

    def _look(self, share: float) -> None:
        """Turn the head towards the cube or the goal, as far as necks go."""
        neck = self.figure.chest(self._trunk(self._help))[:3] + np.array([0.0, 0.2, 0.0])
        away = self._aim() - neck
        yaw = (math.atan2(-away[0], -away[2]) - self._walker.heading + math.pi) % (2.0 * math.pi) - math.pi
        pitch = math.atan2(away[1], math.hypot(away[0], away[2]))
        wanted = np.clip([yaw, pitch], -np.array(GAZE_MOST), GAZE_MOST)
        if self.stage in ("leave", "done"):
            wanted = np.zeros(2)
        self._gaze += share * (wanted - self._gaze)

    def _reached_for(self) -> Floats:
        """World pose (7,) of the hand that holds the cube where it is, or at the goal.

        Once it is there it is to be turned as it is, which limits may have kept from how it should be: a solver that is
        asked for what it cannot give trades millimetres of the place for it, and would never be done.
        """
        placing = self.stage == "place" and self._cube_in_hand is not None
        centre = self._aim() if placing else self.cube[:3]
        rotation = self._grasp(centre)
        turned = rotation if self._held is None or self._hand.share < 1.0 else self._held[3:]
        centre_in_hand = PALM_FROM_WRIST - [0.0, 0.5 * CUBE_M, 0.0]
        if placing and self._cube_in_hand is not None:
            centre_in_hand = self._cube_in_hand[:3]
        return np.concatenate([centre - batch.rotate(turned, centre_in_hand), turned])

    def _grasp(self, centre: Floats) -> Floats:
        """Rotation (4,) of a hand whose palm is on the side of a cube there: fingers forward, thumb up."""
        side = self._hand.side
        sign = 1.0 if side == "right" else -1.0
        shoulder = self.figure.shoulder(self.figure.chest(self._trunk(np.zeros(len(PRIORITY)))), side)
        away = centre - shoulder[:3]
        yaw = math.atan2(-away[0], -away[2])
        pitch = float(np.clip(math.atan2(away[1], math.hypot(away[0], away[2])), -0.9, 0.6))
        forward = batch.multiply(about(1, yaw), about(0, 0.6 * pitch))
        return batch.multiply(forward, about(2, -sign * 0.5 * math.pi))  # the back of the hand outwards

    def _wanted(self, chest: Floats) -> Floats:
        """Pose (7,) in the chest frame that the hand goes over into."""
        side = self._hand.side
        if self.stage in ("reach", "place"):
            return batch.compose(batch.inverse(chest), self._reached_for())
        if self.stage == "carry":
            sign = 1.0 if side == "right" else -1.0
            rotation = batch.multiply(about(1, sign * 0.3), about(2, -sign * 0.5 * math.pi))
            return np.concatenate([CARRIED[side], rotation])
        return self._swing(side)

    def _swing(self, side: Side) -> Floats:
        """Pose (7,) in the chest frame of a hand that swings along with the walk."""
        phase = self._walker.phase + (0.0 if side == "right" else 0.5)
        flexion, elbow, _, _ = cycle(phase) * self._walker.stride
        sign = 1.0 if side == "right" else -1.0
        shoulder = np.array([sign * self.figure.half_width, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        return batch.compose(shoulder, self.figure.swing(side, flexion, 12.0 + elbow))


def _between(a: Floats, b: Floats, share: float) -> Floats:
    """The pose (7,) `share` of the way from a to b."""
    turn = batch.log(batch.multiply(batch.conjugate(a[3:]), b[3:]))
    return np.concatenate([a[:3] + share * (b[:3] - a[:3]), batch.multiply(a[3:], batch.exp(share * turn))])
