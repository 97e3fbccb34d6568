"""The arrays that `arm-ik solve` writes: the names, shapes and meanings that are promised."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import people
import pytest

from arm_ik_service.errors import SessionError
from arm_ik_service.geometry import batch
from arm_ik_service.io.columns import BLOCK
from arm_ik_service.io.session import open_session
from arm_ik_service.io.solution import SolutionWriter
from arm_ik_service.wire.messages import SIDES, TrackingState

GRIPS = {"left": (0.01, -0.02, -0.07), "right": (0.0, -0.03, -0.08)}
PERIOD = 12  # answers that differ
SHAPES = {
    **dict.fromkeys(("shoulder", "elbow", "wrist", "grip"), (3,)),
    "configuration": (10,),
    "velocity": (9,),
    **dict.fromkeys(("tracking", "position_error_m", "orientation_error_rad", "iterations"), ()),
}


def solution(path: Path, count: int) -> dict[str, np.ndarray]:
    states: tuple[TrackingState, ...] = ("lost", "held", "inferred", "tracked")
    writer = SolutionWriter(GRIPS["left"], GRIPS["right"])
    answers = [people.answer(seq, right=states[seq % 4])[1] for seq in range(min(count, PERIOD))]
    for i in range(count):
        writer.write(answers[i % PERIOD])
    writer.save(path)
    assert len(writer) == count
    with np.load(path, allow_pickle=False) as arrays:
        return dict(arrays)


def test_every_array_is_there_with_its_shape_and_no_other(tmp_path: Path) -> None:
    arrays = solution(tmp_path / "a.npz", 12)
    expected = {f"{side}_{name}": (12, *shape) for side in SIDES for name, shape in SHAPES.items()}
    assert {name: array.shape for name, array in arrays.items()} == {"t_ns": (12,), "seq": (12,), **expected}
    assert arrays["t_ns"].dtype == np.int64
    assert arrays["right_tracking"].tolist() == ["lost", "held", "inferred", "tracked"] * 3


def test_the_rows_are_the_answers(tmp_path: Path) -> None:
    count = BLOCK + 3
    arrays = solution(tmp_path / "a.npz", count)
    for seq in (0, BLOCK - 1, BLOCK, count - 1):
        _, answer = people.answer(seq % PERIOD)
        assert arrays["seq"][seq] == answer.seq
        assert arrays["t_ns"][seq] == answer.sample_time_ns
        for side in SIDES:
            arm = getattr(answer, side)
            assert tuple(arrays[f"{side}_shoulder"][seq]) == arm.bones.upper_arm.position
            assert tuple(arrays[f"{side}_elbow"][seq]) == arm.bones.forearm.position
            assert tuple(arrays[f"{side}_wrist"][seq]) == arm.bones.hand.position
            assert arrays[f"{side}_position_error_m"][seq] == arm.position_error_m
            assert arrays[f"{side}_iterations"][seq] == arm.iterations
            hand = [*arm.bones.hand.position, *arm.bones.hand.orientation]
            grip = batch.compose(hand, [*GRIPS[side], 0.0, 0.0, 0.0, 1.0])[:3]
            assert arrays[f"{side}_grip"][seq] == pytest.approx(grip, abs=1e-12)


def test_the_same_answers_give_the_same_bytes(tmp_path: Path) -> None:
    solution(tmp_path / "a.npz", 5)
    solution(tmp_path / "b.npz", 5)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_a_solution_is_not_taken_for_a_session(tmp_path: Path) -> None:
    solution(tmp_path / "a.npz", 5)
    with pytest.raises(SessionError, match="t_ns"):
        open_session(tmp_path / "a.npz")
