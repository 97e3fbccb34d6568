"""The service as a process on a real bus: what it answers, what it refuses, what it survives."""

from __future__ import annotations

import math
import random
import signal
import time
from itertools import pairwise
from pathlib import Path

import msgspec
import pytest
from harness import KEYS, Running, Service, standing, wait_for

from arm_ik_service.io.recording import open_recording
from arm_ik_service.io.zenoh_streams import put_once, query, subscribe
from arm_ik_service.wire import codec
from arm_ik_service.wire.messages import Skeleton, TrackedPose

PERIOD_NS = 11_111_111


def test_every_frame_is_answered_once_with_its_own_number(service: Service) -> None:
    stream = service.stream("7")
    for seq in range(60):
        service.ask(stream, "7", standing(seq, seq * PERIOD_NS))
    answers = service.take(60)
    assert [answer.seq for answer in answers] == list(range(60))
    assert {answer.avatar for answer in answers} == {"7"}
    assert all(answer.receive_time_ns <= answer.publish_time_ns for answer in answers)


def test_a_json_publisher_is_understood_without_being_asked(service: Service) -> None:
    service.stream("web").put(codec.encode(standing(1, 0), "json"))
    assert [answer.seq for answer in service.take(1)] == [1]


def test_the_newest_frame_wins_and_every_other_is_counted(service: Service) -> None:
    for seq in range(2000):  # put so that Zenoh itself drops none
        put_once(service.bus, KEYS.controllers("7"), codec.encode(standing(seq, seq * PERIOD_NS)), "msgpack")
    assert wait_for(lambda: bool(service.healths) and service.healths[-1].answered + service.healths[-1].overtaken > 0)
    assert wait_for(lambda: service.healths[-1].answered + service.healths[-1].overtaken == 2000, 5.0)
    answers = service.take(service.healths[-1].answered)
    assert answers[-1].seq == 1999
    assert [a.seq for a in answers] == sorted({a.seq for a in answers})


def test_a_frame_older_than_the_last_is_refused_and_named_in_health(service: Service) -> None:
    stream = service.stream("7")
    for seq, time_ns in ((1, 10 * PERIOD_NS), (2, 9 * PERIOD_NS), (3, 11 * PERIOD_NS)):
        stream.put(codec.encode(standing(seq, time_ns)))
        time.sleep(0.02)
    assert [answer.seq for answer in service.take(3, 2.0)] == [1, 3]
    assert wait_for(lambda: service.healths[-1].refused == {"out_of_order": 1}, 3.0), service.healths[-1].refused


def test_a_publisher_that_starts_again_with_an_older_clock_is_answered_again(service: Service) -> None:
    stream = service.stream("7")
    for seq in range(5):
        stream.put(codec.encode(standing(seq, 1_000_000_000_000 + seq * PERIOD_NS)))
        time.sleep(0.01)
    assert len(service.take(5)) == 5
    time.sleep(0.15)  # a restart takes longer
    for seq in range(5):
        stream.put(codec.encode(standing(seq, seq * PERIOD_NS)))
        time.sleep(0.01)
    assert [answer.seq for answer in service.take(5)] == list(range(5))


def test_skeleton_and_calibration_answer_queries_for_one_and_for_all(service: Service) -> None:
    for avatar in ("7", "8"):
        service.stream(avatar).put(codec.encode(standing(0, 0)))
    assert len(service.take(2)) == 2
    every = dict(query(service.bus, KEYS.skeleton()))
    assert set(every) == {KEYS.skeleton("7"), KEYS.skeleton("8")}
    skeleton = codec.skeletons.decode(dict(query(service.bus, KEYS.skeleton("7")))[KEYS.skeleton("7")])
    assert skeleton.upper_arm_m == pytest.approx(0.186 * skeleton.stature_m)
    assert len(skeleton.joint_limits) == 9
    calibration = msgspec.msgpack.decode(dict(query(service.bus, KEYS.calibration("8")))[KEYS.calibration("8")])
    assert "grip" in calibration


def test_lengths_that_are_learnt_are_told_again_once_they_have_changed_and_recorded(
    service: Service, tmp_path: Path
) -> None:
    told: list[Skeleton] = []
    subscribe(service.bus, KEYS.skeleton("7"), lambda _key, payload, _t: told.append(codec.skeletons.decode(payload)))
    recorder = Running("record", str(tmp_path / "tall.mcap"), "--connect", service.endpoint)
    recorder.wait_ready()
    stream = service.stream("7")
    eyes = TrackedPose((0.0, 1.85, 0.0), (0.0, 0.0, 0.0, 1.0))
    for seq in range(80):
        service.ask(stream, "7", msgspec.structs.replace(standing(seq, seq * 50_000_000, 0.25), head=eyes))
    assert wait_for(lambda: bool(told) and abs(told[-1].stature_m - 1.85 / 0.936) < 0.03), told
    assert told[0].stature_m == 1.75, "nothing is known of somebody who has just come"
    bones = service.take(80)[-1].right.bones
    upper_arm_m = math.dist(bones.upper_arm.position, bones.forearm.position)
    assert told[-1].upper_arm_m == pytest.approx(upper_arm_m, rel=0.01)
    lengths = [skeleton.upper_arm_m for skeleton in told]
    assert all(abs(b - a) > 0.005 * a for a, b in pairwise(lengths)), "not for every millimetre"
    late = codec.skeletons.decode(dict(query(service.bus, KEYS.skeleton("7")))[KEYS.skeleton("7")])
    assert late == told[-1], "whoever comes late hears what the others did"
    assert recorder.end() == 0
    assert open_recording(tmp_path / "tall.mcap").skeleton("7") == told[-1]


def test_ids_with_odd_characters_are_refused_by_name(service: Service) -> None:
    service.stream("a b").put(codec.encode(standing(0, 0)))
    service.stream("7").put(codec.encode(standing(0, 0)))
    assert [answer.avatar for answer in service.take(2, 2.0)] == ["7"]
    assert service.process.says("'a b'")
    assert wait_for(lambda: service.healths[-1].refused.get("bad_id") == 1, 3.0)


def hostile_payloads(count: int) -> list[bytes]:
    """Return payloads of every kind that is no frame, the same each time."""
    rng = random.Random(4)
    good = msgspec.to_builtins(standing(0, 0))
    nan = float("nan")
    makers = [
        lambda: rng.randbytes(rng.randrange(0, 300)),
        lambda: msgspec.msgpack.encode({"version": 1, "seq": "seven"}),
        lambda: msgspec.msgpack.encode([1, 2, 3]),
        lambda: msgspec.msgpack.encode({**good, "version": 999}),
        lambda: msgspec.msgpack.encode({**good, "head": {"position": [0.0] * 500, "orientation": [0, 0, 0, 1]}}),
        lambda: b"{" * rng.randrange(1, 4000),
        lambda: b"\x81" * rng.randrange(1, 4000),
        lambda: bytes(100_000),
        lambda: msgspec.json.encode({**good, "seq": -5}),
        lambda: codec.encode(standing(0, 0))[: rng.randrange(1, 200)],
    ]
    poisoned = {**good, "left": {"position": [nan, nan, nan], "orientation": [nan, 0.0, 0.0, 0.0], "flags": 15}}
    return [makers[n % len(makers)]() for n in range(count - 100)] + [msgspec.msgpack.encode(poisoned)] * 100


def test_ten_thousand_hostile_payloads_are_counted_and_cost_another_avatar_nothing(service: Service) -> None:
    good, hostile = service.stream("good"), service.stream("hostile")
    payloads = hostile_payloads(10_000)
    for n, payload in enumerate(payloads):  # once before it is measured: Zenoh's own buffers grow to their size
        hostile.put(payload)
        if n % 50 == 0:
            time.sleep(0.005)
    time.sleep(1.0)
    before_kib = service.memory_kib()
    each = len(payloads) // 200
    for seq in range(200):
        for payload in payloads[seq * each : (seq + 1) * each]:
            hostile.put(payload)
        service.ask(good, "good", standing(seq, seq * PERIOD_NS))
    answered = service.take(10_000, 1.5)
    assert [answer.seq for answer in answered if answer.avatar == "good"] == list(range(200))
    assert all(abs(x) < 100.0 for answer in answered for x in answer.left.bones.hand.position)
    health = service.healths[-1]
    assert {"malformed", "too_large"} <= set(health.refused)
    assert service.process.popen.poll() is None
    assert service.memory_kib() - before_kib < 2_048


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_service_cleanly_and_it_says_what_it_served(service: Service, number: signal.Signals) -> None:
    service.stream("7").put(codec.encode(standing(0, 0)))
    assert len(service.take(1)) == 1
    assert service.process.end(number) == 0
    assert any("answered 1 frames" in line for line in service.process.lines)
    assert not any("Traceback" in line for line in service.process.lines)


def test_the_liveliness_token_is_there_as_long_as_the_process_is(service: Service) -> None:
    def alive() -> bool:
        replies = service.bus.liveliness().get(KEYS.liveliness())
        return any(reply.ok is not None for reply in replies)

    assert alive()
    service.process.popen.kill()
    assert wait_for(lambda: not alive(), 12.0)


def test_a_port_in_use_ends_a_second_service_with_one_line_and_code_2(service: Service) -> None:
    second = Running("serve", "--listen", service.endpoint)
    assert second.finish() == 2
    assert len(second.lines) == 1
    assert service.endpoint in second.lines[0]
