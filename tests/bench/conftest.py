"""A made-up motion capture: a person who turns on the spot while both hands reach about."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from arm_ik_service.arm.model import ArmModel
from arm_ik_service.geometry import batch
from arm_ik_service.wire.messages import Side

RATE_HZ = 100.0
FRAMES = 120
SIGNS: dict[Side, float] = {"left": -1.0, "right": 1.0}


def write_capture(path: Path, *, truth: bool = True) -> None:
    """Write a session as ../shared/data/mocap has them; without `truth`, what a headset would have recorded."""
    t = np.arange(FRAMES) / RATE_HZ
    yaw = batch.exp(0.8 * np.sin(t)[:, None] * np.array([0.0, 1.0, 0.0]))
    columns = {"t": t, "head": np.concatenate([np.tile((0.0, 1.65, 0.0), (FRAMES, 1)), yaw], axis=1)}
    for side, sign in SIGNS.items():
        arm = ArmModel.load(side, upper_arm_m=0.29, forearm_m=0.25)
        wave = np.sin(np.outer(3.0 * t, np.ones(7)) + np.arange(7))
        middle = 0.5 * (arm.lower + arm.upper)
        hinges = middle + 0.6 * (arm.upper - middle) * wave[:, 1:]
        q = arm.configurations_at(0.8 + 0.3 * wave[:, 0], 0.5 + wave[:, 1], 0.3 * wave[:, 2], *hinges.T)
        poses = arm.forward(q)
        shoulder = batch.rotate(yaw, (sign * 0.18, 0.0, 0.0)) + np.array([0.0, 1.4, 0.0])
        place = np.concatenate([shoulder, yaw], axis=1)
        hand = batch.compose(place, poses["hand"])
        columns[side] = hand
        if truth:
            columns[f"{side}_shoulder"] = shoulder
            columns[f"{side}_elbow"] = batch.compose(place, poses["elbow"])[:, :3]
            columns[f"{side}_wrist"], columns[f"{side}_wrist_q"] = hand[:, :3], hand[:, 3:]
    with path.open("wb") as file:
        np.savez(file, allow_pickle=False, **columns)


@pytest.fixture(scope="session")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bench") / "reaching.npz"
    write_capture(path)
    return path


@pytest.fixture(scope="session")
def headset_session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bench") / "headset.npz"
    write_capture(path, truth=False)
    return path
