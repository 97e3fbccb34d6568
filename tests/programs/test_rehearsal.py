"""What is solved for nobody goes the way of a frame, every time."""

from __future__ import annotations

from itertools import pairwise

from arm_ik_service.body.profile import Profile
from arm_ik_service.programs.rehearsal import Rehearsal
from arm_ik_service.settings import Settings
from arm_ik_service.wire import codec


def test_every_rehearsal_is_solved_anew_with_moving_arms_and_on_target() -> None:
    rehearsal = Rehearsal(Settings(), Profile())
    states = [codec.arms_states.decode(rehearsal.run()) for _ in range(200)]
    assert all(state.left.tracking == "tracked" for state in states)
    assert all(a.left.configuration != b.left.configuration for a, b in pairwise(states))
    assert max(state.right.position_error_m for state in states) < 5e-3
