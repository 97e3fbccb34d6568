"""All contenders are measured on the same, and what is stopped half-way is dropped whole."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from arm_ik_service.bench.arm_tasks import ArmTask, read_tasks
from arm_ik_service.bench.contender import Contender, Tolerances, first_posture, own
from arm_ik_service.bench.ghosts import save_ghosts
from arm_ik_service.bench.peers import PEERS, Peer
from arm_ik_service.bench.solvers import RECORDED, Comparison, compare
from arm_ik_service.ik.jacobian_transpose import JacobianTranspose
from arm_ik_service.ik.registry import parse_solver

FRAMES = 30


@pytest.fixture(scope="module")
def tasks(capture: Path) -> list[ArmTask]:
    return read_tasks(capture, FRAMES)


@pytest.fixture(scope="module")
def comparison(tasks: list[ArmTask]) -> Comparison:
    contenders = [own(parse_solver(text)) for text in ("jacobian_transpose", "damped_least_squares:damping_m=0.02")]
    return compare(tasks, contenders, Tolerances())


def test_ours_meet_what_a_person_of_these_limits_did(comparison: Comparison) -> None:
    summaries = comparison.summaries()
    assert list(summaries) == ["jacobian_transpose", "damped_least_squares:damping_m=0.02", RECORDED]
    for name in list(summaries)[:2]:
        summary = summaries[name]
        assert summary.frames == 2 * FRAMES
        assert summary.stuck == 0
        assert summary.outside_limits_percent == 0.0
        assert summary.position_mm_p99 is not None
        assert summary.position_mm_p99 < 0.5
        assert summary.us_p50 is not None
        assert summary.us_p50 > 0.0


def test_timing_in_blocks_changes_no_solution(tasks: list[ArmTask], comparison: Comparison) -> None:
    task = tasks[0]
    solver = JacobianTranspose(
        task.arm,
        position_tolerance_m=Tolerances().position_m,
        orientation_tolerance_rad=Tolerances().orientation_rad,
        frame_rate_hz=task.rate_hz,
    )
    track = solver.track(task.targets, first_posture(task, Tolerances()))
    np.testing.assert_array_equal(comparison.results[0][0].configuration, track.configuration)
    np.testing.assert_array_equal(comparison.results[0][0].iterations, track.iterations)


def test_the_object_for_machines_is_json_and_names_everything(comparison: Comparison) -> None:
    found = json.loads(json.dumps(comparison.as_json({"optik": "not installed"})))
    assert found["solvers"]["jacobian_transpose"]["limits"] == "all"
    assert found["arms"][1] == {
        "session": "reaching",
        "side": "right",
        "rate_hz": pytest.approx(100.0),
        "frames": FRAMES,
    }
    assert found["absent"] == {"optik": "not installed"}
    assert found["interrupted"] is False
    assert found["position_tolerance_m"] == 5e-4


def test_progress_counts_every_frame_of_every_contender(tasks: list[ArmTask]) -> None:
    told: dict[str, int] = {}

    def progress(name: str, frames: int) -> None:
        told[name] = told.get(name, 0) + frames

    compare(tasks, [own(parse_solver("pseudo_inverse"))], Tolerances(), progress=progress)
    assert told == {"pseudo_inverse": 2 * FRAMES}


def test_a_stop_keeps_the_arms_that_are_done_by_all(tasks: list[ArmTask]) -> None:
    looks = iter([False, False, False, True])
    contenders = [own(parse_solver(name)) for name in ("pseudo_inverse", "damped_least_squares")]
    stopped = compare(tasks, contenders, Tolerances(), stopped=lambda: next(looks))
    assert stopped.interrupted
    assert [task.side for task in stopped.tasks] == ["left"]
    assert [len(results) for results in stopped.results] == [1, 1]
    assert stopped.summaries()["pseudo_inverse"].frames == FRAMES


def test_a_stop_before_anything_is_done_leaves_nothing_to_show(tasks: list[ArmTask]) -> None:
    stopped = compare(tasks, [own(parse_solver("pseudo_inverse"))], Tolerances(), stopped=lambda: True)
    assert stopped.summaries() == {}
    assert stopped.as_json({})["solvers"] == {}


@pytest.mark.parametrize("peer", PEERS, ids=[peer.name for peer in PEERS])
def test_a_peer_that_is_installed_follows_an_easy_path_to_the_tolerances(peer: Peer, tasks: list[ArmTask]) -> None:
    contender = peer.load()
    if not isinstance(contender, Contender):
        pytest.skip(f"{peer.name} {contender}")
    for task in tasks:
        easy = task._replace(targets=task.targets[:4])  # a person who hardly moves
        result = compare([easy], [contender], Tolerances()).results[0][0]
        assert result.position_error_m.max() < 1e-3
        assert result.orientation_error_rad.max() < 0.02
        assert result.iterations.max() <= 32


def test_a_peer_that_is_missing_says_how_to_install_it() -> None:
    def never(version: str) -> Contender:
        raise AssertionError(version)

    missing = Peer("nobody", "nobody-ik", ("nobody_ik",), never)
    assert missing.load() == "not installed: pip install nobody-ik"


def test_all_arms_become_ghosts_in_a_recording(comparison: Comparison, tmp_path: Path) -> None:
    from rerun.chunk import RrdReader

    path = tmp_path / "arms.rrd"
    save_ghosts(path, comparison)
    entities = set()
    for chunk in RrdReader(str(path)).stream():
        entities.add(str(chunk.entity_path))
    for side in ("left", "right"):
        for name in ("target", RECORDED, "jacobian_transpose", "residual_mm/jacobian_transpose"):
            assert f"/reaching/{side}/{name}" in entities
