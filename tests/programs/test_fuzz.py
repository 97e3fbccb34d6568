"""A live service under a hundred thousand payloads that are almost frames.

A campaign: pytest -m slow tests/programs/test_fuzz.py
"""

from __future__ import annotations

import time
from itertools import islice
from typing import Any

import pytest
from harness import Service, standing
from hostile import changes, payloads
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from arm_ik_service.wire import codec

COUNT = 100_000
GOOD_EVERY = 50  # payloads to a good frame of somebody else
PERIOD_NS = 11_111_111


def drawn(count: int) -> list[bytes]:
    found: list[bytes] = []

    @given(changed=changes, seed=st.integers(0, 2**32))
    @settings(max_examples=count // 200, deadline=None, suppress_health_check=list(HealthCheck), database=None)
    def draw(changed: dict[str, Any], seed: int) -> None:
        found.extend(payloads(changed, seed, 100))

    draw()
    return list(islice(found, count))


@pytest.mark.slow
def test_a_hundred_thousand_hostile_payloads_leave_the_service_its_memory_and_another_avatar_its_answers(
    service: Service,
) -> None:
    good, hostile = service.stream("good"), [service.stream(f"hostile-{n}") for n in range(20)]
    everything = drawn(COUNT)
    memory_kib: list[int] = []
    sent = 0
    for n, payload in enumerate(everything):
        hostile[n % len(hostile)].put(payload)
        if n % GOOD_EVERY == 0:
            good.put(codec.encode(standing(sent, sent * PERIOD_NS)))
            sent += 1
            time.sleep(0.01)
        if n % (COUNT // 10) == 0:
            memory_kib.append(service.memory_kib())
    time.sleep(1.5)
    answered = [answer for answer in service.take(10 * COUNT, 0.0) if answer.avatar == "good"]
    assert len(answered) >= 0.99 * sent
    assert service.process.popen.poll() is None
    assert not any("Traceback" in line for line in service.process.lines)
    assert max(memory_kib[5:]) - memory_kib[4] < 2_048
