"""Messages survive the wire; what is not a message is refused with the reason, whatever the bytes."""

from __future__ import annotations

import json
import math

import msgspec
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from arm_ik_service.errors import DecodeError, VersionError, WireError
from arm_ik_service.wire import codec
from arm_ik_service.wire.messages import VERSION, ControllerFrame, Encoding, TrackedPose

numbers = st.floats(-100.0, 100.0)
triples = st.tuples(numbers, numbers, numbers)
poses = st.builds(
    TrackedPose,
    position=triples,
    orientation=st.tuples(numbers, numbers, numbers, numbers),
    flags=st.integers(0, 15),
    linear_velocity=st.none() | triples,
    angular_velocity=st.none() | triples,
)
frames = st.builds(
    ControllerFrame,
    version=st.just(VERSION),
    seq=st.integers(0, 2**62),
    sample_time_ns=st.integers(-(2**62), 2**62),
    publish_time_ns=st.integers(0, 2**62),
    space=st.sampled_from(["stage", "local_floor", "local"]),
    head=st.none() | poses,
    left=st.none() | poses,
    right=st.none() | poses,
)
FRAME = ControllerFrame(VERSION, 7, 1_000, 2_000, "stage", TrackedPose((0, 1.6, 0), (0, 0, 0, 1)), None, None)
ENCODINGS: tuple[Encoding, ...] = ("msgpack", "json")


@pytest.mark.parametrize("encoding", ENCODINGS)
@given(frame=frames)
def test_a_frame_comes_back_as_it_went_in_either_encoding(encoding: Encoding, frame: ControllerFrame) -> None:
    assert codec.controller_frames.decode(codec.encode(frame, encoding)) == frame


@given(st.binary(max_size=600))
@example(b"")
@example(b"{" * 5000)
@example(b"\x81" * 5000)
@example(b"\x91" * 5000)
@example(b"[" * 5000)
@example(codec.encode(FRAME)[:-1])
@example(codec.encode(FRAME) + b"\x00")
@example(b'{"version": 1' + b" " * 100)
@example(b"\xff\xfe{\x00")
def test_bytes_that_are_no_message_raise_a_wire_error_and_nothing_else(payload: bytes) -> None:
    with pytest.raises(WireError):
        codec.controller_frames.decode(payload)


@given(st.dictionaries(st.text(max_size=8), st.recursive(st.none() | st.integers() | st.text(), st.lists), max_size=6))
def test_a_map_of_the_wrong_shape_is_refused(shape: dict[str, object]) -> None:
    try:
        payload = msgspec.msgpack.encode(shape)
    except OverflowError:  # hypothesis likes integers that MessagePack cannot hold
        return
    with pytest.raises(WireError):
        codec.controller_frames.decode(payload)


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("$.head.position", [0.0, 1.0]),
        ("$.head.position[1]", [0.0, "high", 0.0]),
        ("$.head.orientation", [0.0] * 100_000),
        ("$.seq", -1),
        ("$.space", "view"),
        ("$.left", 5),
    ],
)
def test_the_error_names_the_path_of_the_field(path: str, value: object, encoding: Encoding) -> None:
    tree = msgspec.to_builtins(FRAME)
    node = tree
    *parents, leaf = path.removeprefix("$.").split("[")[0].split(".")
    for name in parents:
        node = node[name]
    node[leaf] = value
    payload = (msgspec.msgpack if encoding == "msgpack" else msgspec.json).encode(tree)
    with pytest.raises(DecodeError) as error:
        codec.controller_frames.decode(payload)
    assert path.split("[")[0] in str(error.value)


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("other", [{"version": 999}, {"version": 999, "head": "of another shape"}])
def test_another_version_is_named_as_the_cause_even_if_its_shape_differs(
    other: dict[str, object], encoding: Encoding
) -> None:
    tree = {**msgspec.to_builtins(FRAME), **other}
    payload = (msgspec.msgpack if encoding == "msgpack" else msgspec.json).encode(tree)
    with pytest.raises(VersionError, match="999"):
        codec.controller_frames.decode(payload)


def test_a_field_that_is_not_known_is_ignored() -> None:
    tree = {**msgspec.to_builtins(FRAME), "grip_strength": 0.5}
    assert codec.controller_frames.decode(msgspec.json.encode(tree)) == FRAME


def test_not_a_number_reaches_the_tracking_stage_which_judges_each_device_apart() -> None:
    frame = msgspec.structs.replace(FRAME, left=TrackedPose((math.nan, 0, 0), (0, 0, 0, 1)))
    left = codec.controller_frames.decode(codec.encode(frame)).left
    assert left is not None
    assert math.isnan(left.position[0])


def test_the_schema_describes_the_message() -> None:
    schema = codec.json_schema(ControllerFrame)
    properties = schema["$defs"]["ControllerFrame"]["properties"]
    assert set(properties) == {field.name for field in msgspec.structs.fields(ControllerFrame)}
    json.dumps(schema)
