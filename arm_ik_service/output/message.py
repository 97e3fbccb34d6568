"""The MessagePack of an answer, written by compiled code from the record: to build the objects first costs 40 us.

An ArmsState is a header that its publisher knows, and a body that the record holds. The body always has the same
fields in the same order, so it is a list of steps, each of them constant bytes and the number that follows. What comes
out is byte for byte what msgspec makes of the same ArmsState.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import msgspec
import numpy as np

from arm_ik_service.arm.model import LIMITS
from arm_ik_service.compiled import compiled, inlined
from arm_ik_service.output.record import OUTPUT
from arm_ik_service.wire import codec
from arm_ik_service.wire.messages import (
    TRACKING_STATES,
    ArmsHeader,
    ArmsState,
    ArmState,
    Bones,
    IsbShoulder,
    JointAngles,
    Pose,
)

# what follows a step's bytes, or decides on them
NOTHING = 0
FLOAT = 1
COUNT = 2  # a whole number from 0 on
SIZE_OF_MASK = 3  # the head of an array with an element for each set bit
IF_EQUAL = 4  # the bytes only where the number is `operand`
IF_BIT = 5  # the bytes only where this bit of the number is set

_text = msgspec.msgpack.encode
assert len(LIMITS) <= 15, "the head of a longer array is no single byte"


class Step(NamedTuple):
    """Constant bytes, and what is done with the number at `source`, counted in 64 bits from the record's beginning."""

    literal: bytes
    kind: int = NOTHING
    source: int = 0
    operand: int = 0


class _Choice(tuple[Step, ...]):
    """Steps that together write one value."""


def _places(of: Any, name: str, begin: int) -> list[int]:
    kind, offset = of.fields[name][:2]
    first = begin + offset // 8
    return list(range(first, first + kind.itemsize // 8))


def _floats(of: Any, name: str, begin: int) -> tuple[Any, ...]:
    return tuple(Step(b"", FLOAT, place) for place in _places(of, name, begin))


def _pose(of: Any, name: str, begin: int) -> Pose:
    numbers = _floats(of, name, begin)
    return Pose(numbers[:3], numbers[3:])


def _state(place: int) -> Any:
    return _Choice(Step(_text(state), IF_EQUAL, place, n) for n, state in enumerate(TRACKING_STATES))


def _arm(side: int) -> ArmState:
    """Return an arm with steps in the place of its values: msgspec leaves it to mypy to check what it is given."""
    arms, offset = OUTPUT.fields["arms"][:2]  # type: ignore[index]
    of = arms.base
    begin = (offset + side * of.itemsize) // 8

    def place(name: str) -> int:
        return _places(of, name, begin)[0]

    def number(name: str) -> Any:
        return Step(b"", FLOAT, place(name))

    def numbers(name: str) -> Any:
        return _floats(of, name, begin)

    truth = _Choice(Step(_text(bool(n)), IF_EQUAL, place("isb_singular"), n) for n in range(2))
    iterations: Any = Step(b"", COUNT, place("iterations"))
    names = (Step(_text(name), IF_BIT, place("limits"), bit) for bit, name in enumerate(LIMITS))
    limits: Any = _Choice((Step(b"", SIZE_OF_MASK, place("limits")), *names))
    return ArmState(
        tracking=_state(place("state")),
        position_tracking=_state(place("position_state")),
        orientation_tracking=_state(place("rotation_state")),
        configuration=numbers("configuration"),
        velocity=numbers("velocity"),
        angles=JointAngles(*numbers("angles")),
        angle_rates=JointAngles(*numbers("angle_rates")),
        isb_shoulder=IsbShoulder(*(*numbers("isb"), truth)),
        bones=Bones(*(_pose(of, bone, begin) for bone in Bones.__struct_fields__)),
        position_error_m=number("position_error_m"),
        orientation_error_rad=number("orientation_error_rad"),
        reach_ratio=number("reach_ratio"),
        iterations=iterations,
        limits=limits,
        elbow_confidence=number("elbow_confidence"),
    )


def _steps(part: Any) -> Iterator[Step]:
    """Walk through a message whose values are steps."""
    if isinstance(part, Step):
        yield part
    elif isinstance(part, _Choice):
        yield from part
    elif isinstance(part, tuple):
        yield Step(bytes([0x90 | len(part)]))
        for element in part:
            yield from _steps(element)
    else:
        fields = msgspec.structs.asdict(part)
        yield Step(bytes([0x80 | len(fields)]))
        for name, value in fields.items():
            yield Step(_text(name))
            yield from _steps(value)


def _body() -> Iterator[Step]:
    """Return the steps of the fields that ArmsState adds to its header, bytes that follow each other joined."""
    fields = {
        "chest": _pose(OUTPUT, "chest", 0),
        "head": _pose(OUTPUT, "head", 0),
        "left": _arm(0),
        "right": _arm(1),
    }
    assert (*ArmsHeader.__struct_fields__, *fields) == ArmsState.__struct_fields__
    waiting = b""
    for name, value in fields.items():
        for step in (Step(_text(name)), *_steps(value)):
            if step.kind == NOTHING:
                waiting += step.literal
            elif step.kind in (IF_EQUAL, IF_BIT):
                if waiting:
                    yield Step(waiting)
                waiting = b""
                yield step
            else:
                yield step._replace(literal=waiting + step.literal)
                waiting = b""


def _script() -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    literals, table = b"", []
    for step in _body():
        begin = len(literals) // 8
        literals += step.literal + b"\0" * (-len(step.literal) % 8)
        table.append((begin, len(literals) // 8, len(step.literal), *step[1:]))
    return np.frombuffer(literals, "<i8").astype(np.int64), np.array(table, np.int64)


# Arguments of what is compiled, not constants in it: numba's cache would not see that a message has changed. Literals
# are whole words: what one writes too much, the next writes over.
LITERALS, STEPS = _script()
BODY_BYTES = 8 * len(LITERALS) + 9 * len(STEPS)  # the longest number is a byte and eight more


@compiled
def write_body(numbers: Any, literals: Any, steps: Any, out: Any) -> int:
    """Write the body of the record whose `numbers` (N,) int64 these are into `out` (BODY_BYTES,); return its length."""
    at = np.uint64(0)  # of a signed index the compiler must think that it may count from the end
    for n in range(len(steps)):
        kind, number, operand = steps[n, 3], numbers[steps[n, 4]], steps[n, 5]
        if (kind == IF_EQUAL and number != operand) or (kind == IF_BIT and not number >> operand & 1):
            continue
        end = at + np.uint64(steps[n, 2])
        for word in range(steps[n, 0], steps[n, 1]):
            for i in range(8):  # one instruction, as is the loop of a float
                out[at + np.uint64(i)] = literals[word] >> 8 * i & 0xFF
            at += np.uint64(8)
        at = end
        if kind == FLOAT:
            out[at] = 0xCB
            at = _write_number(out, at + np.uint64(1), number, 8)
        elif kind == COUNT:
            at = _write_count(out, at, number)
        elif kind == SIZE_OF_MASK:
            count = 0
            for bit in range(15):
                count += number >> bit & 1
            out[at] = 0x90 | count
            at += np.uint64(1)
    return int(at)


@inlined
def _write_number(out: Any, at: Any, number: int, size: int) -> Any:
    """Write the last `size` bytes of a whole number, the highest first; return where they end."""
    for i in range(size):
        out[at + np.uint64(i)] = number >> 8 * (size - 1 - i) & 0xFF
    return at + np.uint64(size)


@compiled
def _write_count(out: Any, at: Any, number: int) -> Any:
    """Write a whole number in the shortest of its forms, as msgspec does; return where it ends."""
    size = 1
    if number >= 0x80:
        size, head = (1, 0xCC) if number < 0x100 else (2, 0xCD) if number < 0x10000 else (4, 0xCE)
        out[at] = head
        at += np.uint64(1)
    return _write_number(out, at, number, size)


def read_output(output: np.ndarray[Any, Any], header: ArmsHeader) -> ArmsState:
    """Return the message that a record (1,) of dtype OUTPUT holds."""
    body = np.zeros(BODY_BYTES, np.uint8)
    length = write_body(output.view(np.int64), LITERALS, STEPS, body)
    return codec.arms_states.decode(codec.join(header, body.data[:length]))
