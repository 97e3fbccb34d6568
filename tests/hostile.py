"""Payloads that are almost frames: the right fields with wrong values, and the bytes of that broken in every way."""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import Any

import msgspec
from harness import standing
from hypothesis import strategies as st

numbers = st.one_of(
    st.integers(-(2**70), 2**70), st.floats(), st.sampled_from([0, -1, 2**62, 2**62 + 1, 2**63, 2**64, 1e308, -0.0])
)
scalars = st.one_of(numbers, st.none(), st.booleans(), st.text(max_size=20), st.binary(max_size=20))
anything = st.recursive(
    scalars,
    lambda inner: st.one_of(st.lists(inner, max_size=5), st.dictionaries(st.text(max_size=8), inner, max_size=4)),
)
poses = st.one_of(
    st.none(),
    st.fixed_dictionaries(
        {},
        optional={
            "position": st.one_of(
                st.lists(st.floats(), min_size=3, max_size=3), st.lists(numbers, max_size=5), anything
            ),
            "orientation": st.one_of(st.lists(st.floats(), min_size=4, max_size=4), anything),
            "flags": st.one_of(st.integers(0, 15), numbers),
            "linear_velocity": st.one_of(st.none(), st.lists(st.floats(), min_size=3, max_size=3), anything),
            "angular_velocity": st.one_of(st.none(), st.lists(st.floats(), min_size=3, max_size=3)),
        },
    ),
    anything,
)
changes = st.dictionaries(
    st.sampled_from(["version", "seq", "sample_time_ns", "publish_time_ns", "space", "head", "left", "right", "new"]),
    st.one_of(poses, anything),
    max_size=4,
)


def encoded(changed: dict[str, Any]) -> Iterator[bytes]:
    """Yield a good frame with some fields changed, in both forms where they can be written at all."""
    message = {**msgspec.to_builtins(standing(0, 0)), **changed}
    for encode in (msgspec.msgpack.encode, msgspec.json.encode):
        try:
            yield encode(message)
        except (msgspec.MsgspecError, OverflowError, TypeError):
            continue


def broken(payload: bytes, rng: random.Random) -> bytes:
    """Return the payload with bytes changed, lost, doubled or moved."""
    data = bytearray(payload)
    for _ in range(rng.randrange(1, 4)):
        if not data:
            break
        at, to = sorted((rng.randrange(len(data) + 1), rng.randrange(len(data) + 1)))
        what = rng.randrange(6)
        if what == 0:
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        elif what == 1:
            data[rng.randrange(len(data))] = rng.choice((0x00, 0x7B, 0x80, 0x90, 0xC1, 0xCB, 0xDD, 0xDF, 0xFF))
        elif what == 2:
            del data[at:to]
        elif what == 3:
            data[at:at] = data[at:to]
        elif what == 4:
            data[at:at] = rng.randbytes(rng.randrange(1, 9))
        else:
            del data[at:]
    return bytes(data)


def payloads(changed: dict[str, Any], seed: int, each: int) -> Iterator[bytes]:
    """Yield what `encoded` does, and `each` broken copies of it."""
    rng = random.Random(seed)
    for payload in encoded(changed):
        yield payload
        for _ in range(each):
            yield broken(payload, rng)
