"""What compiled code writes is what msgspec would have written, whatever the numbers are."""

from __future__ import annotations

import math
import struct

import msgspec
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from arm_ik_service import Avatars, Profile, Settings
from arm_ik_service.arm.model import LIMITS
from arm_ik_service.io.session import open_session
from arm_ik_service.output.message import BODY_BYTES, LITERALS, STEPS, read_output, write_body
from arm_ik_service.output.record import OUTPUT
from arm_ik_service.programs.demo import bundled_session
from arm_ik_service.wire import codec
from arm_ik_service.wire.messages import ArmsHeader, ArmsState, ArmState

STATES = ("lost", "held", "inferred", "tracked")
INTEGERS = {"isb_singular": 1, "state": 3, "position_state": 3, "rotation_state": 3, "limits": 2 ** len(LIMITS) - 1}
headers = st.builds(
    ArmsHeader,
    version=st.just(1),
    avatar=st.text(max_size=300),
    seq=st.integers(0, 2**62),
    sample_time_ns=st.integers(-(2**62), 2**62),
    receive_time_ns=st.integers(-(2**62), 2**62),
    solve_time_ns=st.integers(0, 2**62),
    publish_time_ns=st.integers(0, 2**62),
)
HEADER = ArmsHeader(1, "me", 5, 6, 7, 8, 9)


@st.composite
def outputs(draw: st.DrawFn) -> np.ndarray:
    """Return a record (1,) of numbers of every kind, not a number among them."""
    output = np.zeros(1, OUTPUT)
    count = OUTPUT.itemsize // 8
    output.view(np.float64)[:] = draw(st.lists(st.floats(), min_size=count, max_size=count))
    for side in range(2):
        for name, most in INTEGERS.items():
            output["arms"][name][0, side] = draw(st.integers(0, most))
        output["arms"]["iterations"][0, side] = draw(st.integers(0, 2**31))
    return output


def same(a: object, b: object) -> bool:
    """Compare the bits of every number: not a number is itself, and minus nought is not nought."""
    return msgspec.msgpack.encode(a) == msgspec.msgpack.encode(b)


def assert_arm_is(arm: ArmState, record: np.void) -> None:
    assert same(arm.configuration, record["configuration"].tolist())
    assert same(arm.velocity, record["velocity"].tolist())
    assert same(msgspec.structs.astuple(arm.angles), record["angles"].tolist())
    assert same(msgspec.structs.astuple(arm.angle_rates), record["angle_rates"].tolist())
    assert same(msgspec.structs.astuple(arm.isb_shoulder)[:3], record["isb"].tolist())
    assert arm.isb_shoulder.singular == bool(record["isb_singular"])
    for name in arm.bones.__struct_fields__:
        bone = getattr(arm.bones, name)
        assert same((*bone.position, *bone.orientation), record[name].tolist())
    for name in ("position_error_m", "orientation_error_rad", "reach_ratio", "elbow_confidence", "iterations"):
        assert same(getattr(arm, name), record[name].item())
    assert arm.tracking == STATES[record["state"]]
    assert arm.position_tracking == STATES[record["position_state"]]
    assert arm.orientation_tracking == STATES[record["rotation_state"]]
    assert arm.limits == tuple(name for bit, name in enumerate(LIMITS) if record["limits"] >> bit & 1)


@given(outputs(), headers)
def test_a_record_becomes_the_message_of_its_numbers(output: np.ndarray, header: ArmsHeader) -> None:
    state = read_output(output, header)
    for name in ArmsHeader.__struct_fields__:
        assert getattr(state, name) == getattr(header, name)
    assert same((*state.chest.position, *state.chest.orientation), output["chest"][0].tolist())
    assert same((*state.head.position, *state.head.orientation), output["head"][0].tolist())
    assert_arm_is(state.left, output["arms"][0, 0])
    assert_arm_is(state.right, output["arms"][0, 1])


def written(output: np.ndarray, header: ArmsHeader) -> bytes:
    body = np.zeros(BODY_BYTES, np.uint8)
    return codec.join(header, body.data[: write_body(output.view(np.int64), LITERALS, STEPS, body)])


@given(outputs(), headers)
def test_the_bytes_are_those_that_msgspec_writes(output: np.ndarray, header: ArmsHeader) -> None:
    assert written(output, header) == codec.encode(read_output(output, header))


@given(st.integers(0, 2**31))
@example(127)
@example(128)
@example(255)
@example(256)
@example(65535)
@example(65536)
def test_a_count_has_its_shortest_form(iterations: int) -> None:
    output = np.zeros(1, OUTPUT)
    output["arms"]["iterations"] = iterations
    payload = written(output, HEADER)
    assert codec.arms_states.decode(payload).left.iterations == iterations
    assert payload == codec.encode(codec.arms_states.decode(payload))


def test_what_is_not_a_number_keeps_its_bits() -> None:
    (strange,) = struct.unpack("<d", struct.pack("<Q", 0x7FF0_0000_DEAD_BEEF))
    output = np.zeros(1, OUTPUT)
    output["chest"][0, 0] = strange
    assert struct.pack(">d", strange) in written(output, HEADER)
    assert math.isnan(read_output(output, HEADER).chest.position[0])


@pytest.mark.parametrize("name", ["reach_and_grab", "tracking_loss"])
def test_an_answer_in_either_form_is_the_same_answer(name: str) -> None:
    avatars = Avatars(Settings())
    avatars.reset(0, Profile())
    for recorded in list(open_session(bundled_session(name)).frames())[:400]:
        frame = recorded.frame
        avatars.add(0, frame, frame.sample_time_ns)
        avatars.step()
        plain = avatars.payload(0, frame, "me", 1, 2, 3)
        state = codec.arms_states.decode(plain)
        assert plain == codec.encode(state)
        assert avatars.payload(0, frame, "me", 1, 2, 3, "json") == codec.encode(state, "json")
        assert isinstance(state, ArmsState)
