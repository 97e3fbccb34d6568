"""No bytes whatever hurt the decoder, and no frame that it lets through hurts the arms.

A campaign: ARM_IK_FUZZ=1000000 pytest tests/wire/test_fuzz.py
"""

from __future__ import annotations

import os
import tracemalloc
from contextlib import suppress
from typing import Any

from hostile import changes, payloads
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from arm_ik_service.avatar import Avatar
from arm_ik_service.errors import DecodeError, VersionError
from arm_ik_service.wire import codec

COUNT = int(os.environ.get("ARM_IK_FUZZ", "20000"))
EACH = 100  # broken copies of one drawn frame
EXAMPLES = max(1, COUNT // (2 * EACH + 2))
MAY_GROW_BYTES = 20_000


def test_every_payload_is_a_frame_or_a_decode_error_and_every_frame_is_answered_with_numbers() -> None:
    avatar = Avatar()
    tried = accepted = 0
    now_ns = 0

    @given(changed=changes, seed=st.integers(0, 2**32))
    @settings(max_examples=EXAMPLES, deadline=None, suppress_health_check=list(HealthCheck), database=None)
    def campaign(changed: dict[str, Any], seed: int) -> None:
        nonlocal tried, accepted, now_ns
        for payload in payloads(changed, seed, EACH):
            tried += 1
            try:
                frame = codec.controller_frames.decode(payload)
            except (DecodeError, VersionError):
                continue
            accepted += 1
            now_ns += 11_111_111
            state = avatar.step(frame, now_ns)
            if state is not None:
                numbers = codec.encode(state, "json")
                assert b"null" not in numbers  # what is not finite is written so
                assert all(abs(x) < 1e3 for x in state.left.bones.hand.position)

    campaign()
    assert tried > 0.5 * COUNT
    assert accepted > 0


def test_bytes_that_are_refused_leave_nothing_behind() -> None:
    refused = [
        *payloads({"head": {"position": [1.0, "x", {}]}, "seq": 2**70}, 7, 1000),
        *payloads({"version": 9}, 8, 1000),
    ]

    def refuse_all() -> int:
        for payload in refused:
            with suppress(DecodeError, VersionError):
                codec.controller_frames.decode(payload)
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        refuse_all()
        before = refuse_all()
        for _ in range(5):
            after = refuse_all()
    finally:
        tracemalloc.stop()
    assert after - before < MAY_GROW_BYTES
