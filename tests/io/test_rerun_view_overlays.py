"""What explains an arm: dials, region, circle and ball, held to the model that they are drawn of."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt
import pytest
from people import SKELETON, answer
from rerun.chunk import RrdReader

from arm_ik_service.arm.model import ANGLES, ArmModel
from arm_ik_service.avatar import Avatar
from arm_ik_service.body.profile import Profile
from arm_ik_service.cli.options import show_option
from arm_ik_service.errors import SettingsError
from arm_ik_service.geometry import batch
from arm_ik_service.io.rerun_view import OVERLAYS, RerunView, Save
from arm_ik_service.io.rerun_view.gauges import (
    BRACKET_M,
    DIALS,
    LEAST_CIRCLE_M,
    RADIUS_M,
    REGION_RADIUS_M,
    Arm,
    dial,
    elbow_bracket,
    elbow_circle,
    inside,
    swing_region,
)
from arm_ik_service.io.rerun_view.rows import RESTS, row_of
from arm_ik_service.programs.elbow_comfort import ElbowComforts
from arm_ik_service.skeleton import skeleton_of
from arm_ik_service.wire.messages import SIDES, ArmsState, Side

Floats = npt.NDArray[np.float64]


def states(count: int = 40) -> list[ArmsState]:
    """A person whose hands wander."""
    avatar, found = Avatar(Profile()), []
    rng = np.random.default_rng(3)
    wander = np.cumsum(rng.normal(scale=0.02, size=(count, 2, 3)), axis=0)
    for seq in range(count):
        frame, _ = answer(seq, lifts=(0.9, 0.5))
        assert frame.left is not None
        assert frame.right is not None
        moved = {
            side: msgspec.structs.replace(pose, position=tuple((np.array(pose.position) + by).tolist()))
            for side, pose, by in zip(SIDES, (frame.left, frame.right), wander[seq], strict=True)
        }
        state = avatar.step(msgspec.structs.replace(frame, **moved), now_ns=frame.sample_time_ns)
        assert state is not None
        found.append(state)
    return found


@pytest.fixture(scope="module")
def rows() -> Floats:
    return np.array([row_of(None, state) for state in states()])


def direction_from(points: Floats, centre: Floats) -> Floats:
    return batch.normalized(points - centre)


@pytest.mark.parametrize("side", SIDES)
def test_the_needle_of_a_hinge_points_along_the_bone_that_it_turns(side: Side, rows: Floats) -> None:
    arm = Arm.of(side, rows)
    forearm = direction_from(arm.hand[:, :3], arm.forearm[:, :3])
    _, needle = dial(arm, "elbow_flexion", 0.0, 2.6)
    carrying = arm.angles[:, ANGLES.index("elbow_carrying")]
    off = np.arccos(np.clip(np.sum(direction_from(needle[:, -1], arm.forearm[:, :3]) * forearm, axis=1), -1.0, 1.0))
    np.testing.assert_allclose(off, np.abs(carrying), atol=1e-6)
    _, needle = dial(arm, "wrist_deviation", -0.4, 0.7)
    fingers = batch.rotate(arm.hand[:, 3:], (0.0, 0.0, -1.0))
    np.testing.assert_allclose(direction_from(needle[:, -1], arm.hand[:, :3]), fingers, atol=1e-6)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("name", DIALS)
def test_a_needle_is_on_its_arc_where_the_angle_is_in_its_range(side: Side, name: str, rows: Floats) -> None:
    arm = Arm.of(side, rows)
    now = arm.angles[:, ANGLES.index(name)]
    arc, needle = dial(arm, name, float(now[0] - 0.3), float(now[0] + 0.5))
    step = 0.8 / (arc.shape[1] - 1)
    place = round(0.3 / step)
    assert np.linalg.norm(arc[0, place] - needle[0, -1]) < step * RADIUS_M[name]
    ends = np.linalg.norm(arc[0, [0, -1]] - needle[0, -1], axis=1)
    np.testing.assert_allclose(ends, 2.0 * RADIUS_M[name] * np.sin([0.15, 0.25]), atol=1e-6)


@pytest.mark.parametrize("side", SIDES)
def test_the_elbow_and_all_of_its_circle_are_as_far_from_shoulder_and_wrist(side: Side, rows: Floats) -> None:
    arm = Arm.of(side, rows)
    circle, reachable, spoke = elbow_circle(arm, None)
    elbow = arm.forearm[:, None, :3]
    for end in (arm.upper_arm[:, None, :3], arm.hand[:, None, :3]):
        away = np.linalg.norm(elbow - end, axis=2)
        np.testing.assert_allclose(np.linalg.norm(circle - end, axis=2), np.repeat(away, circle.shape[1], 1), atol=1e-9)
    np.testing.assert_allclose(spoke[:, -1], elbow[:, 0], atol=1e-9)
    np.testing.assert_allclose(reachable, circle, atol=1e-9)


@pytest.mark.parametrize("side", SIDES)
def test_the_bright_part_of_the_circle_holds_the_elbow_and_ends_at_the_shoulders_limit(
    side: Side, rows: Floats
) -> None:
    region = skeleton_of("ann", Profile()).shoulder_swing
    assert region is not None
    arm = Arm.of(side, rows)
    circle, reachable, _ = elbow_circle(arm, region)
    assert (np.linalg.norm(reachable - arm.forearm[:, None, :3], axis=2).min(axis=1) < 1e-9).all()
    assert np.ptp(reachable, axis=1).max() > 0.05
    model = ArmModel.load(side)
    for points, all_round, chest, shoulder in zip(reachable, circle, arm.chest, arm.upper_arm, strict=True):
        ends = points[[0, -1]]
        if np.allclose(ends[0], ends[1]):
            continue  # it may go all the way round
        beyond = [
            all_round[np.linalg.norm(all_round - end, axis=1).argmin() + by]
            for end, by in zip(ends, (-1, 1), strict=True)
        ]
        assert not swing_allowed(model, beyond - shoulder[:3], chest).any()


@pytest.mark.parametrize("side", SIDES)
def test_the_bracket_stands_on_the_circle_and_off_the_arm_between_its_swivels(side: Side, rows: Floats) -> None:
    _, _, spoke = elbow_circle(Arm.of(side, rows), None)
    bent = np.linalg.norm(spoke[:, -1] - spoke[:, 0], axis=1) > LEAST_CIRCLE_M
    straight = elbow_bracket(Arm.of(side, rows[~bent]), np.tile([-0.3, 0.5], ((~bent).sum(), 1)))
    assert (np.ptp(straight, axis=1) == 0.0).all()
    arm, spoke = Arm.of(side, rows[bent]), spoke[bent]
    bracket = elbow_bracket(arm, np.tile([-0.3, 0.5], (bent.sum(), 1)))
    centre, radius = spoke[:, 0], np.linalg.norm(spoke[:, -1] - spoke[:, 0], axis=1)
    away = np.linalg.norm(bracket - centre[:, None], axis=2)
    np.testing.assert_allclose(away[:, [0, -1]], np.repeat(radius[:, None], 2, 1), atol=1e-9)
    np.testing.assert_allclose(away[:, 1:-1], np.repeat(radius[:, None] + BRACKET_M, away.shape[1] - 2, 1), atol=1e-9)
    axis = batch.normalized(arm.hand[:, :3] - arm.upper_arm[:, :3])
    for end, swivel in ((0, -0.3), (-1, 0.5)):
        turned = centre + batch.rotate(batch.exp(swivel * axis), spoke[:, -1] - centre)
        np.testing.assert_allclose(bracket[:, end], turned, atol=1e-9)


def test_the_swivel_overlay_has_a_bracket_where_comfort_is_told_and_else_none(tmp_path: Path) -> None:
    told = logged(tmp_path / "told.rrd", frozenset({"swivel"}), comfort=ElbowComforts())
    untold = logged(tmp_path / "untold.rrd", frozenset({"swivel"}))
    for found, strips in ((told, 4), (untold, 3)):
        assert {len(lines) for lines in found["left/swivel", "LineStrips3D:strips"]} == {strips}  # type: ignore[arg-type]
        assert np.isfinite(np.array(found["left/swivel", "LineStrips3D:strips"], float)).all()


def swing_allowed(model: ArmModel, away: Floats, chest: Floats) -> npt.NDArray[np.bool_]:
    """What the arm model itself says of humeri that point along `away` (N,3)."""
    local = batch.rotate(batch.conjugate(chest[3:]), batch.normalized(away))
    local[:, 0] *= 1.0 if model.side == "right" else -1.0
    isb = batch.rotate(batch.conjugate(model.chains[0].shoulder_from_isb), local)
    half = np.sqrt(np.maximum(0.5 * (1.0 - isb[:, 1]), 1e-12))
    q = np.zeros((len(isb), 10))
    q[:, 0], q[:, 2], q[:, 3] = -isb[:, 2] / (2 * half), isb[:, 0] / (2 * half), half
    q[:, :4] = batch.normalized(q[:, :4])
    return np.asarray(model.excess(q)[:, 0] <= 0.0)


def test_inside_and_outside_the_region_are_what_the_model_says() -> None:
    model = ArmModel.load()
    region = skeleton_of("ann", Profile()).shoulder_swing
    assert region is not None
    rng = np.random.default_rng(0)
    azimuth, share = rng.uniform(-np.pi, np.pi, 500), rng.uniform(0.0, 1.3, 500)
    angle = np.minimum(share * model.swing_edge(azimuth), np.pi - 0.01)
    q = model.configurations_at(angle, azimuth, *(np.zeros(500),) * 7)
    forearm = model.forward(q)["elbow"][:, :3]
    said = inside(region, batch.normalized(forearm))
    clear = np.abs(angle - model.swing_edge(azimuth)) > np.radians(2.0)
    np.testing.assert_array_equal(said[clear], model.excess(q)[clear, 0] <= 0.0)
    assert 100 < said.sum() < 450


def test_the_outline_of_the_left_shoulder_is_the_mirror_image_of_the_right(rows: Floats) -> None:
    region = skeleton_of("ann", Profile()).shoulder_swing
    assert region is not None
    local = {}
    for side in SIDES:
        arm = Arm.of(side, rows)
        away = swing_region(arm, region) - arm.upper_arm[:, None, :3]
        np.testing.assert_allclose(np.linalg.norm(away, axis=2), REGION_RADIUS_M, atol=1e-9)
        local[side] = batch.rotate(batch.conjugate(arm.chest[:, None, 3:]), away)
    np.testing.assert_allclose(local["left"] * [-1.0, 1.0, 1.0], local["right"], atol=1e-9)


def test_a_persons_own_limits_are_the_ones_that_are_told() -> None:
    profile = msgspec.convert({"limits_deg": {"elbow_flexion": [5.0, 120.0]}}, Profile)
    limits = {limit.name: (limit.lower, limit.upper) for limit in skeleton_of("ann", profile).joint_limits}
    np.testing.assert_allclose(np.degrees(limits["elbow_flexion"]), [5.0, 120.0])
    plain = {limit.name: limit.upper for limit in skeleton_of("ann", Profile()).joint_limits}
    assert plain["elbow_flexion"] > limits["elbow_flexion"][1]


def logged(
    path: Path, show: frozenset[str], rests: tuple[str, ...] = (), comfort: ElbowComforts | None = None
) -> dict[tuple[str, str], list[object]]:
    skeleton = msgspec.structs.replace(skeleton_of("ann", Profile()), avatar="ann")
    overlays = frozenset(overlay for overlay in OVERLAYS if overlay in show)
    with RerunView(Save(path), show=overlays, comfort=comfort) as view:
        view.describe(skeleton)
        for seq in range(3):
            frame, arms = answer(seq)
            view.add(msgspec.structs.replace(arms, left=msgspec.structs.replace(arms.left, limits=rests)), frame)
    found: dict[tuple[str, str], list[object]] = {}
    for chunk in RrdReader(path).stream():
        batched = chunk.to_record_batch()
        for k, field in enumerate(batched.schema):
            if ":" in field.name and not chunk.is_static:
                key = (chunk.entity_path.removeprefix("/avatar/ann/"), field.name.rsplit("/", 1)[-1])
                found.setdefault(key, []).extend(batched.column(k).to_pylist())
    return found


@pytest.mark.parametrize("overlay", OVERLAYS)
def test_an_overlay_is_logged_where_it_is_asked_for_and_only_there(tmp_path: Path, overlay: str) -> None:
    plain = {entity for entity, _ in logged(tmp_path / "plain.rrd", frozenset())}
    shown = {entity for entity, _ in logged(tmp_path / "shown.rrd", frozenset({overlay}))}
    names = ("limits/joints", "limits/swing") if overlay == "limits" else (overlay,)
    assert shown - plain == {f"{side}/{name}" for side in SIDES for name in names}


def test_the_dial_of_a_limit_that_the_arm_rests_on_is_red(tmp_path: Path) -> None:
    found = logged(tmp_path / "view.rrd", frozenset({"limits"}), ("pronation",))
    left, right = (np.array(found[f"{side}/limits/joints", "LineStrips3D:colors"]) for side in SIDES)
    changed = (left[0] != right[0]).reshape(-1, 2)[:, 0]
    assert list(np.array(DIALS)[changed]) == ["pronation"], "of the arcs; needles differ by their sides' colours"


def test_the_ghost_is_where_the_raw_target_has_the_hand_and_not_where_the_solver_has_it(tmp_path: Path) -> None:
    found = logged(tmp_path / "view.rrd", frozenset({"ghost"}))
    hand = np.array(found["right/hand", "Transform3D:translation"], float)
    ghost = np.array(found["right/ghost", "Transform3D:translation"], float)
    np.testing.assert_allclose((ghost - hand)[:, 0], [(0.0, 0.02, 0.0)] * 3, atol=1e-5)


def test_the_ball_is_as_large_as_the_arm_is_long(tmp_path: Path) -> None:
    found = logged(tmp_path / "view.rrd", frozenset({"reach"}))
    scale = np.array(found["left/reach", "Transform3D:scale"], float)
    np.testing.assert_allclose(scale, SKELETON.upper_arm_m + SKELETON.forearm_m, rtol=1e-5)


def test_every_limit_an_arm_can_rest_on_is_a_column_of_the_rows() -> None:
    assert set(RESTS) == set(skeleton_of("ann", Profile()).limit_names) - {"joint_speed"}


def test_overlays_are_chosen_by_name() -> None:
    assert show_option(None) == frozenset()
    assert show_option("reach, limits") == {"reach", "limits"}
    assert show_option("all") == set(OVERLAYS)
    with pytest.raises(SettingsError, match=r"halo.*reach, swivel, limits, ghost"):
        show_option("halo,reach")
