"""Measuring a person, and reporting on a recording, as a user runs them."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from harness import COMMAND, KEYS, Running, Service, wait_for

from arm_ik_service.io.zenoh_streams import put_once, query
from arm_ik_service.programs.demo import bundled_session
from arm_ik_service.wire import codec

pytestmark = pytest.mark.slow  # real processes, one after the other: the default run has three minutes


def arm_ik(*arguments: str, profiles: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "ARM_IK_PROFILES": str(profiles)}
    return subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, timeout=120, env=environment)


def test_a_person_is_measured_from_movement_and_saved_by_name_for_every_command(tmp_path: Path) -> None:
    session = str(bundled_session("boxing"))
    found = arm_ik("calibrate", session, "--name", "anna", "--json", profiles=tmp_path)
    assert found.returncode == 0, found.stderr
    report = json.loads(found.stdout)
    body = report["profile"]["body"]
    length = body["upper_arm_m"] + body["forearm_m"]
    assert length == pytest.approx((0.186 + 0.146) * 1.75, rel=0.15)
    assert report["arm_length_deviation_m"] < 0.06
    assert (tmp_path / "anna.toml").is_file()
    solved = arm_ik("solve", session, "-o", str(tmp_path / "out.npz"), "--profile", "anna", profiles=tmp_path)
    assert solved.returncode == 0, solved.stderr
    unknown = arm_ik("solve", session, "-o", str(tmp_path / "out.npz"), "--profile", "bert", profiles=tmp_path)
    assert unknown.returncode == 2
    assert "anna" in unknown.stderr


def test_a_live_calibration_is_taken_over_by_the_running_service(service: Service, tmp_path: Path) -> None:
    player = Running("replay", str(bundled_session("boxing")), "--avatar", "anna", "--connect", service.endpoint)
    before = service.take(1)[0]
    live = ["calibrate", "--avatar", "anna", "--seconds", "6", "--json", "--connect", service.endpoint]
    found = arm_ik(*live, profiles=tmp_path)
    assert found.returncode == 0, found.stderr
    measured = json.loads(found.stdout)["profile"]["body"]
    assert service.process.says("measured anew")
    service.take(10_000, 0.3)
    (after,) = service.take(1)
    skeleton = codec.skeletons.decode(dict(query(service.bus, KEYS.skeleton("anna")))[KEYS.skeleton("anna")])
    assert skeleton.upper_arm_m == pytest.approx(measured["upper_arm_m"])
    bones = after.right.bones
    length = np.linalg.norm(np.subtract(bones.forearm.position, bones.upper_arm.position))
    assert length == pytest.approx(measured["upper_arm_m"], abs=1e-6)
    assert after.seq > before.seq
    put_once(service.bus, KEYS.calibration("anna"), b'{"body": {"stature_m": 17}}', "json")
    assert wait_for(lambda: service.healths[-1].refused.get("calibration") == 1, 3.0)
    assert player.end() == 0


def test_a_t_pose_that_is_none_is_refused_with_what_is_seen_instead(tmp_path: Path) -> None:
    session = str(bundled_session("reach_and_grab"))
    refused = arm_ik("calibrate", session, "--pose", "t_pose", profiles=tmp_path)
    assert refused.returncode == 2
    assert len(refused.stderr.strip().splitlines()) == 1
    assert "arm" in refused.stderr


def test_a_report_finds_the_losses_that_were_put_into_the_recording(tmp_path: Path) -> None:
    checked = arm_ik("check", str(bundled_session("tracking_loss")), "--json", profiles=tmp_path)
    assert checked.returncode == 0, checked.stderr
    (person,) = json.loads(checked.stdout)["avatars"]
    devices = person["devices"]["devices"]
    assert devices["head"]["tracked"] > 0.99
    assert devices["left"]["tracked"] < 0.9
    assert devices["left"]["longest_loss_s"] == pytest.approx(2.3, abs=0.3)  # the controller that sleeps on the table
    assert person["arms"]["left"]["position_error_p50_m"] < 1e-3
    table = arm_ik("check", str(bundled_session("tracking_loss")), profiles=tmp_path)
    assert table.returncode == 0
    assert "longest loss" in table.stdout.replace("\n", " ")
