"""The trunk gives way: it turns to where the arms have room, and towards what they reach for."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from losses import publish
from persons import LEFT, RIGHT, Take, run, standing, stroke, yaw_degrees

from arm_ik_service.body.profile import BodyMeasures, Profile
from arm_ik_service.body.state import BODY
from arm_ik_service.body.step import initialise_body
from arm_ik_service.body.trunk import GIVES_AT_MOST_RAD, REACHED_TOO_FAR, give_way
from arm_ik_service.geometry import batch
from arm_ik_service.ik.state import ARM
from arm_ik_service.tracking.state import TRACKING

Array = npt.NDArray[np.float64]
MEASURED = Profile(body=BodyMeasures(upper_arm_m=0.3, forearm_m=0.26, shoulder_width_m=0.34))
FRAME_S = 1.0 / 90.0


class Person:
    """Someone who stands upright, at the origin, for a while already: what they give in a second."""

    def __init__(self, profile: Profile = MEASURED) -> None:
        self.bodies, self.tracking, self.arms = np.zeros(1, BODY), np.zeros(1, TRACKING), np.zeros(2, ARM)
        initialise_body(self.bodies[0], profile)
        body = self.bodies[0]
        body["since_s"] = 10.0
        body["wrists"]["position"] = [(-0.3, -0.3, -0.2), (0.3, -0.3, -0.2)]

    def gives(self) -> Array:
        body: Any = self.bodies[0]
        for _ in range(90):
            give_way(body, self.tracking[0], self.arms, FRAME_S)
        return np.array(body["gives"]["at"])


@pytest.mark.parametrize("side", [0, 1])
def test_it_turns_and_bends_as_relieves_an_arm_and_never_to_the_side(side: int) -> None:
    person = Person()
    person.arms["relief"][side] = (0.04, -0.1, 0.2)
    bend, turn, aside = person.gives()
    assert 0.1 < bend < 0.2
    assert -0.5 < turn < -0.3
    assert aside == 0.0


def test_two_arms_that_want_the_opposite_leave_it_where_it_is() -> None:
    person = Person()
    person.arms["relief"] = [(0.0, 0.1, 0.0), (0.0, -0.1, 0.0)]
    assert np.abs(person.gives()).max() < 1e-12


def test_it_gives_no_more_than_a_trunk_goes() -> None:
    person = Person()
    person.arms["relief"][1] = (1.0, 2.0, 0.0)
    assert np.linalg.norm(person.gives()) == pytest.approx(GIVES_AT_MOST_RAD, rel=1e-3)


def test_it_comes_back_when_there_is_room_again() -> None:
    person = Person()
    person.arms["relief"][1] = (0.0, 0.2, 0.0)
    assert person.gives()[1] > 0.5
    person.arms["relief"] = 0.0
    assert np.abs(person.gives()).max() < 1e-6


@pytest.mark.parametrize("side", [0, 1])
def test_it_turns_the_shoulder_towards_a_hand_too_far_ahead(side: int) -> None:
    person = Person()
    person.bodies["wrists"]["position"][0, side] = (0.17 * (2 * side - 1), 0.0, -0.56 * REACHED_TOO_FAR - 0.03)
    _, turn, _ = person.gives()
    assert turn * (2 * side - 1) > 0.1  # to the left, positive, for the right hand


def test_a_hand_too_far_away_lengthens_arms_that_are_being_learnt_and_turns_nobody() -> None:
    person = Person(Profile())
    person.bodies["wrists"]["position"][0, 1] = (0.17, 0.0, -0.9)
    assert not person.gives().any()


def test_what_is_not_seen_says_nothing() -> None:
    person = Person()
    person.arms["relief"][1] = (0.0, 0.2, 0.0)
    person.bodies["wrists"]["position"][0, 1] = (0.17, 0.0, -0.9)
    person.tracking["hands"]["position_age_s"][0, 1] = 0.01
    assert not person.gives().any()


def test_an_arm_that_cannot_be_turned_as_asked_says_nothing_of_its_shoulder() -> None:
    person = Person()
    person.arms["relief"][1] = (0.0, 0.2, 0.0)
    person.arms["work"]["orientation_error_rad"][1] = 0.5
    assert not person.gives().any()


def test_the_less_sure_the_grip_the_less_the_arms_say() -> None:
    turns = []
    for learnt_rad in (0.0, 0.05, 0.2):
        person = Person()
        person.arms["relief"][1] = (0.0, 0.1, 0.0)
        person.bodies["grip"]["turn"][0] = (learnt_rad, 0.0, 0.0)
        turns.append(person.gives()[1])
    assert turns[1] == pytest.approx(0.5 * turns[0])
    assert 0.0 < turns[2] < 0.1 * turns[0]


def spotting(degrees: float) -> Take:
    """Someone whose head stays as it is while their hands go round to the left by so much, and stay there."""
    take = standing(2.0)
    take = take.moved(LEFT, [0.0, 0.15, 0.0]).moved(RIGHT, [0.0, 0.15, 0.0])
    turn = np.radians(degrees) * stroke(take.t, 0.7, 0.5, [0.0, 1.0, 0.0])
    around = np.concatenate([np.zeros_like(turn), batch.exp(turn)], axis=1)
    poses = take.poses.copy()
    poses[:, 1:] = batch.compose(around[:, None], poses[:, 1:])
    return Take(take.t, poses, take.flags)


def test_arms_turn_a_chest_that_the_head_does_not() -> None:
    take = spotting(130.0)
    without = yaw_degrees(run(take.frames, profile=MEASURED).body["chest_rotation"])[-1]
    with_arms = yaw_degrees(publish(take, MEASURED).chests[:, 3:])[-1]
    assert 0.0 < without < 80.0
    assert with_arms > without + 5.0
