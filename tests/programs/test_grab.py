"""The reach scene: somebody walks to a cube, takes it, carries it, and follows it where it is put."""

from __future__ import annotations

import itertools
import json
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt
import pytest
from harness import wait_for
from mcap.reader import make_reader

from arm_ik_service.errors import SettingsError
from arm_ik_service.ik.registry import SOLVERS, SolverChoice
from arm_ik_service.io.session import open_session
from arm_ik_service.io.zenoh_bus import BusOptions, open_client, open_hub
from arm_ik_service.io.zenoh_streams import query, subscribe
from arm_ik_service.programs.demo import free_endpoint
from arm_ik_service.programs.grab.helpers import MOST, PRIORITY, recruit
from arm_ik_service.programs.grab.legs import legs
from arm_ik_service.programs.grab.live import CUBE_KEY, GrabShow, cube_pose
from arm_ik_service.programs.grab.scene import RATE_HZ, Moment, Scene
from arm_ik_service.programs.grab.walk import CYCLE_M, SPEED_M_S, Walker, cycle
from arm_ik_service.wire import codec
from arm_ik_service.wire.keys import Keys

pytestmark = pytest.mark.slow  # real processes, one after the other: the default run has three minutes

Floats = npt.NDArray[np.float64]
CUBE, GOAL = np.array([0.4, 1.2, -1.7]), np.array([-0.8, 0.6, -1.4])


@cache
def performance() -> tuple[Moment, ...]:
    return tuple(Scene(CUBE, GOAL).moments(30.0))


def hands(moments: tuple[Moment, ...]) -> Floats:
    return np.array([m.arms.right.bones.hand.position for m in moments])


def test_the_cube_comes_to_its_goal_by_way_of_every_stage() -> None:
    stages = [stage for stage, _ in itertools.groupby(m.stage for m in performance())]
    assert stages == ["walk", "reach", "carry", "place", "leave", "done"]
    np.testing.assert_allclose(performance()[-1].cube[:3], GOAL, atol=0.005)


def test_the_cube_moves_only_in_the_hand_and_with_it() -> None:
    carried = [m for m in performance() if m.stage in ("carry", "place")]
    for m in performance():
        if m.stage in ("walk", "reach"):
            np.testing.assert_array_equal(m.cube[:3], CUBE)
    away = [np.linalg.norm(m.cube[:3] - m.arms.right.bones.hand.position) for m in carried[1:]]
    assert np.ptp(away) < 1e-6
    assert 0.06 < away[0] < 0.11, "it is in the palm"


def test_nothing_jumps_where_walking_blends_into_reaching() -> None:
    moments = performance()
    steps = np.linalg.norm(np.diff(hands(moments), axis=0), axis=1) * RATE_HZ
    assert steps.max() < 5.0, "m/s"
    chests = np.array([m.arms.chest.position for m in moments])
    assert (np.linalg.norm(np.diff(chests, axis=0), axis=1) * RATE_HZ).max() < 2.0
    elbows = np.array([m.arms.right.bones.forearm.position for m in moments])
    assert (np.linalg.norm(np.diff(elbows, axis=0), axis=1) * RATE_HZ).max() < 5.0


def test_the_bones_hang_together() -> None:
    for m in performance()[::40]:
        for side in (m.arms.left, m.arms.right):
            upper, fore, hand = (
                np.array(b.position) for b in (side.bones.upper_arm, side.bones.forearm, side.bones.hand)
            )
            np.testing.assert_allclose(np.linalg.norm(upper - fore), 0.186 * 1.75, atol=1e-9)
            np.testing.assert_allclose(np.linalg.norm(fore - hand), 0.146 * 1.75, atol=1e-9)


def test_a_low_goal_asks_the_trunk_for_help_and_lets_go_of_it_again() -> None:
    most = {name: max(m.help_given[name] for m in performance()) for name in PRIORITY}
    assert most["clavicle"] > 0.9 * MOST[0]
    assert most["lean"] > 0.2
    assert max(performance()[-1].help_given.values()) < 0.02


def test_a_foot_that_stands_stays_where_it_is_and_none_goes_through_the_floor() -> None:
    """At full stride; the leg is a little short for the foot where it is set down."""
    walk = [
        legs(np.array([0.0, -phase * CYCLE_M]), 0.0, float(cycle(phase)[2]), 1.75, phase, 1.0)
        for phase in np.linspace(0.0, 1.0, 201)
    ]
    ankles = np.array(walk)[:, :, 2]
    standing = ankles[20:60, 1]  # of the right foot, from 0.1 to 0.3 of the cycle
    assert np.ptp(standing, axis=0).max() < 0.03
    swinging = ankles[110:190, 1]
    assert -np.ptp(swinging[:, 2]) < -0.8, "it overtakes the body"
    assert ankles[..., 1].min() > 0.03
    np.testing.assert_allclose(ankles[100, 0] - ankles[0, 1], [-0.18, 0.0, -0.5 * CYCLE_M], atol=1e-6)


def test_legs_hang_together_and_knees_bend_forwards() -> None:
    for m in performance()[::10]:
        hips, knees, ankles, toes = np.moveaxis(m.legs, 1, 0)
        np.testing.assert_allclose(np.linalg.norm(knees - hips, axis=1), 0.245 * 1.75, atol=1e-6)
        np.testing.assert_allclose(np.linalg.norm(ankles - knees, axis=1), 0.246 * 1.75, atol=1e-6)
        ahead = (toes - ankles) * [1.0, 0.0, 1.0]
        assert (np.sum((knees - 0.5 * (hips + ankles)) * ahead, axis=1) > 0.0).all()
        assert (m.legs[..., 1] > -0.02).all()


def test_the_recording_holds_the_cube_and_is_a_session_like_any_other(tmp_path: Path) -> None:
    path = tmp_path / "grab.mcap"
    show = GrabShow(Scene(CUBE, GOAL), record=path)
    show.run(4.0, real_time=False)
    show.close()
    with path.open("rb") as file:
        messages = [
            (schema.name, message.log_time, json.loads(message.data))
            for schema, _, message in make_reader(file).iter_messages(topics=[CUBE_KEY])
            if schema is not None
        ]
    assert {name for name, _, _ in messages} == {"arm_ik.Pose"}
    told = [pose["position"] for _, _, pose in messages]
    np.testing.assert_allclose(told, [m.cube[:3] for m in performance()[: len(told)]], atol=1e-12)
    assert np.ptp(told, axis=0).max() > 0.3, "it was carried"
    session = open_session(path)
    assert session.avatars == ("grab",)
    frames = list(session.frames())
    assert [time for _, time, _ in messages] == [one.receive_time_ns for one in frames]
    assert not session.warnings


def test_it_is_the_same_every_time() -> None:
    again = list(itertools.islice(Scene(CUBE, GOAL).moments(30.0), 200))
    assert [m.arms for m in again] == [m.arms for m in performance()[:200]]


@pytest.mark.parametrize("when", ["reach", "place"])
def test_a_cube_that_is_put_elsewhere_is_followed(when: str) -> None:
    scene, elsewhere = Scene(CUBE, GOAL), np.array([0.9, 1.1, -1.0, 0.0, 0.0, 0.0, 1.0])
    moved = False
    for moment in scene.moments(30.0):
        if moment.stage == when and not moved:
            for _ in range(20):
                scene.step()
            scene.move_cube(elsewhere)
            moved = True
    assert moved
    assert moment.stage == "done"
    np.testing.assert_allclose(moment.cube[:3], GOAL, atol=0.01)


@pytest.mark.parametrize("name", SOLVERS)
def test_every_solver_drives_it_to_its_end(name: str) -> None:
    """To a goal that asks for a hand turned further than a wrist goes: three of them once traded the place for that."""
    *_, last = Scene(CUBE, GOAL, choice=SolverChoice(name, {})).moments(12.0)
    assert last.stage == "done"
    np.testing.assert_allclose(last.cube[:3], GOAL, atol=0.004)


def test_a_cube_on_the_left_is_taken_with_the_left_hand() -> None:
    *_, last = Scene(np.array([-0.4, 1.2, -0.6])).moments(2.5)
    assert last.stage == "carry"
    assert np.linalg.norm(last.cube[:3] - last.arms.left.bones.hand.position) < 0.11


def test_a_cube_out_of_all_reach_is_reached_for_and_nothing_breaks() -> None:
    *_, last = Scene(np.array([0.2, 3.5, -0.6])).moments(2.5)
    assert last.stage == "reach"
    assert np.isfinite(last.arms.right.configuration).all()
    assert last.arms.right.position_error_m > 0.5
    assert last.arms.right.bones.hand.position[1] > last.arms.right.bones.upper_arm.position[1], "the arm is raised"


def test_helpers_give_the_least_that_will_do_in_their_order() -> None:
    weight = np.array([1.0, 0.1, 0.5, 1.0])  # how many metres each unit brings

    def missing(distance: float, given: Floats) -> float:
        return distance - float(weight @ given)

    np.testing.assert_array_equal(recruit(lambda given: missing(-0.01, given)), 0.0)
    np.testing.assert_allclose(recruit(lambda given: missing(0.03, given)), [0.03, 0, 0, 0], atol=1e-4)
    some = recruit(lambda given: missing(0.08, given))
    np.testing.assert_allclose(some, [MOST[0], 0.3, 0.0, 0.0], atol=2e-3)
    everything = recruit(lambda given: missing(9.0, given))
    np.testing.assert_allclose(everything, MOST)


def test_a_helper_that_only_makes_it_worse_is_not_used() -> None:
    given = recruit(lambda given: 0.2 - given[0] + 0.5 * given[3])
    assert given[3] == 0.0


def test_the_walk_is_a_closed_and_smooth_cycle() -> None:
    values = np.array([cycle(phase) for phase in np.linspace(0.0, 2.0, 801)])
    np.testing.assert_allclose(values[:401], values[400:], atol=1e-9)
    slopes = np.diff(values, axis=0)
    assert (np.abs(np.diff(slopes, axis=0)).max(axis=0) < 0.02 * np.ptp(values, axis=0)).all()


def test_a_walker_stands_still_before_its_goal_and_has_swung_in_time_with_its_way() -> None:
    walker, goal = Walker(np.zeros(2)), np.array([3.0, -4.0])
    fastest = 0.0
    for _ in range(900):
        walker.step(goal, 0.45, 1.0 / 90.0)
        fastest = max(fastest, walker.speed)
    assert walker.speed < 1e-3
    np.testing.assert_allclose(np.linalg.norm(walker.place - goal), 0.45, atol=0.01)
    assert fastest == pytest.approx(SPEED_M_S)
    assert walker.phase * CYCLE_M == pytest.approx(4.55, rel=0.1)


@pytest.mark.parametrize(
    "payload",
    [b"", b"{}", b'{"position": [1, 2]}', b'{"position": [1, 2, 1e9]}', b"\x93\x01\x02\x03",
     b'{"position": [0, 1, 0], "orientation": [0, 0, 0, 0]}', msgspec.msgpack.encode({"position": [float("nan")] * 3})],
)  # fmt: skip
def test_what_is_no_place_for_a_cube_is_refused(payload: bytes) -> None:
    with pytest.raises(SettingsError, match="scene/cube/pose"):
        cube_pose(payload)


def test_a_place_may_come_in_either_encoding_and_without_axes() -> None:
    told = {"position": [0.1, 1.0, -2.0], "orientation": [0.0, 0.0, 0.0, 2.0]}
    for payload in (msgspec.json.encode(told), msgspec.msgpack.encode(told), b'{"position": [0.1, 1, -2]}'):
        np.testing.assert_allclose(cube_pose(payload), [0.1, 1.0, -2.0, 0.0, 0.0, 0.0, 1.0])


def test_on_a_bus_the_cube_is_a_key_and_the_arms_are_published() -> None:
    endpoint = free_endpoint()
    with open_hub(BusOptions(listen=(endpoint,))) as hub, open_client(BusOptions(connect=(endpoint,))) as client:
        answers: list[bytes] = []
        show = GrabShow(Scene(CUBE, GOAL), bus=hub)
        watched: list[bytes] = []
        ear = subscribe(client, Keys().arms("grab"), lambda _key, payload, _time: answers.append(payload))
        eye = subscribe(client, Keys().watched_arms("grab"), lambda _key, payload, _time: watched.append(payload))
        place = {"position": [0.7, 1.1, -2.0]}

        def put_and_play() -> bool:
            client.put(CUBE_KEY, msgspec.json.encode(place))
            client.put(CUBE_KEY, b"nonsense")
            last = show.run(0.1, real_time=True)
            return last is not None and bool(last.cube[0] == 0.7) and show.refused > 0

        assert wait_for(put_and_play)
        assert wait_for(lambda: len(answers) > 0 and len(watched) > 0)
        arms = codec.arms_states.decode(answers[-1])
        assert arms.avatar == "grab"
        told = [msgspec.json.decode(payload) for _, payload in query(client, CUBE_KEY)]
        assert [one["position"] for one in told] == [place["position"]]
        ear.undeclare()
        eye.undeclare()
        show.close()
