"""What health is told from."""

from __future__ import annotations

from typing import Any

import pytest

from arm_ik_service.avatar import Avatars
from arm_ik_service.body.profile import BodyMeasures, Profile
from arm_ik_service.programs.seats import Seat, outgrown


def person(avatars: Avatars, index: int, stature_m: float) -> Seat:
    profile = Profile(body=BodyMeasures(stature_m=stature_m))
    avatars.reset(index, profile)
    stream: Any = None  # nothing is put
    return Seat(f"p{index}", index, stream, profile, avatars.measures(index, profile), 0)


def test_people_are_as_long_as_their_skeletons_tell_whoever_they_are() -> None:
    avatars = Avatars(capacity=3)
    seats = [person(avatars, index, stature_m) for index, stature_m in enumerate((1.2, 1.75, 2.1))]
    assert outgrown(seats, avatars.lengths([0, 1, 2])) == []


@pytest.mark.parametrize("which", range(4))
def test_who_has_outgrown_one_length_noticeably_is_found_among_others(which: int) -> None:
    avatars = Avatars(capacity=3)
    seats = [person(avatars, index, 1.75) for index in range(3)]
    lengths = avatars.lengths([2, 0, 1])
    lengths[2, which] *= 0.985
    lengths[1, which] *= 1.005
    assert outgrown([seats[2], seats[0], seats[1]], lengths) == [seats[1]]
