"""When the tracked space moves under all devices at once, everything follows in the same frame."""

from __future__ import annotations

import numpy as np
import pytest
from persons import HEAD, LEFT, RIGHT, Array, run, standing, stroke

from arm_ik_service.geometry import batch
from arm_ik_service.tracking.state import TRACKED


def motion(yaw_degrees: float, x: float, z: float) -> Array:
    return np.concatenate([[x, 0.0, z], batch.exp([0.0, np.radians(yaw_degrees), 0.0])])


@pytest.mark.parametrize(("yaw", "x", "z"), [(90.0, 0.0, 0.0), (180.0, 1.0, -2.0), (0.0, 0.5, 0.0), (-35.0, 0.2, 0.3)])
def test_a_recentre_is_followed_at_once(yaw: float, x: float, z: float) -> None:
    take = standing(1.0)
    take = take.moved(RIGHT, stroke(take.t, 0.3, 0.4, [0.1, 0.4, -0.2]))
    moved = take.in_space(motion(yaw, x, z), slice(45, None))
    made = run(moved.frames)
    assert made.tracking["recentres"][-1] == 1
    for device in (HEAD, LEFT, RIGHT):
        assert (made.device(device)["position_state"] == TRACKED).all()
        assert np.linalg.norm(made.position(device) - moved.poses[:, device, :3], axis=1).max() < 3.1e-3
    speed = np.linalg.norm(made.device(RIGHT)["linear_velocity"], axis=1)
    assert speed.max() < 3.0


def test_the_body_turns_with_the_space_in_the_same_frame() -> None:
    take = standing(1.0)
    pose = motion(120.0, 0.4, -1.0)
    still, moved = run(take.frames), run(take.in_space(pose, slice(45, None)).frames)
    expected = batch.compose(pose, np.concatenate([still.body["chest_position"], still.body["chest_rotation"]], axis=1))
    assert np.abs(moved.body["chest_position"][45:] - expected[45:, :3]).max() < 1e-6
    assert batch.angle_between(moved.body["chest_rotation"][45:], expected[45:, 3:]).max() < 1e-6
    assert np.abs(moved.body["targets"]["position"][45:] - still.body["targets"]["position"][45:]).max() < 1e-6


def test_a_jump_of_the_head_alone_is_no_recentre() -> None:
    take = standing(1.0)
    take.poses[45:, HEAD, :3] += (0.6, 0.0, 0.0)
    made = run(take.frames)
    assert made.tracking["recentres"][-1] == 0
    assert made.position(HEAD)[45] == pytest.approx(take.poses[0, HEAD, :3], abs=1e-3)


def test_someone_who_walks_and_looks_around_is_not_recentred() -> None:
    take = standing(3.0)
    walk = stroke(take.t, 0.5, 2.0, [3.0, 0.0, 0.0])
    for device in (HEAD, LEFT, RIGHT):
        take = take.moved(device, walk)
    take = take.turned(HEAD, batch.exp(np.sin(4.0 * take.t)[:, None] * np.array([0.0, 1.0, 0.0])))
    assert run(take.frames).tracking["recentres"][-1] == 0
