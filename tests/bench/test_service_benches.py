"""The benches of the service run, count what they should, and print a table or one JSON object."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from harness import COMMAND

from arm_ik_service.bench.attached import ARRANGEMENTS, Attached
from arm_ik_service.bench.capacity import Step, memory, most_carried
from arm_ik_service.bench.latency import RoundTrips
from arm_ik_service.bench.load import Measured
from arm_ik_service.wire.messages import VERSION, Health


def bench(*arguments: str) -> dict[str, object]:
    result = subprocess.run([*COMMAND, "bench", *arguments, "--json"], capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, result.stderr
    found: dict[str, object] = json.loads(result.stdout)
    return found


def measured(avatars: int, share: float = 1.0, service_ms: float = 1.0, client_ms: float = 2.0) -> Measured:
    return Measured(avatars, 100, share, share, share, service_ms, service_ms, client_ms, client_ms, client_ms, 0)


@pytest.mark.slow
def test_latency_answers_every_frame_and_every_echo() -> None:
    found = bench("latency", "--frames", "60")
    for line in ("service", "echo"):
        trips = found[line]
        assert isinstance(trips, dict)
        assert trips["answered"] == trips["sent"] == 60
        assert 0.0 < trips["p50_ms"] <= trips["p99_ms"] <= trips["max_ms"]
    assert found["p50_ratio"] == found["service"]["p50_ms"] / found["echo"]["p50_ms"]  # type: ignore[index]


@pytest.mark.slow
def test_latency_beside_sinks_answers_every_frame_of_every_arrangement() -> None:
    found = bench("latency", "--sinks", "--frames", "60")
    for name in ARRANGEMENTS:
        arrangement = found[name]
        assert isinstance(arrangement, dict)
        (block,) = arrangement["blocks"]
        assert block["answered"] == block["sent"] == 60
        assert arrangement["p99_ratio"] == block["p99_ms"] / found["alone"]["p99_ms"]  # type: ignore[index]


def test_ratios_are_of_blocks_of_the_same_round() -> None:
    def block(p99_ms: float) -> RoundTrips:
        return RoundTrips(10, 10, p99_ms / 2.0, p99_ms, p99_ms)

    blocks = {"alone": [block(1.0), block(10.0), block(1.0)], "sinks": [block(2.0), block(11.0), block(1.1)]}
    attached = Attached(90.0, blocks)
    assert attached.p99_ratio("sinks") == pytest.approx(1.1)
    assert attached.p99_ms("sinks") == 2.0
    assert attached.p50_ratio("alone") == 1.0


@pytest.mark.slow
def test_a_soak_tells_shares_times_and_memory() -> None:
    found = bench("soak", "--avatars", "5", "--seconds", "4")
    inner = found["measured"]
    assert isinstance(inner, dict)
    assert inner["avatars"] == 5
    assert inner["least_share"] <= inner["answered_share"] <= inner["most_share"] <= 1.0
    assert inner["answered_share"] > 0.5
    assert isinstance(found["memory_mb"], float)


@pytest.mark.slow
def test_a_killed_service_is_replaced_within_a_second_and_only_its_share_comes_back() -> None:
    found = bench("failover", "--avatars", "40")
    assert found["unanswered"] == found["doubles_settled"] == found["misplaced"] == 0
    assert sum(found["shares"].values()) == 40  # type: ignore[attr-defined]
    assert float(found["lost_gap_s"]) < 1.0  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux" or os.geteuid() != 0, reason="makes a network namespace: Linux and root")
def test_a_service_whose_link_is_cut_is_replaced_within_three_seconds() -> None:
    found = bench("failover", "--avatars", "40", "--cut")
    assert found["unanswered"] == found["doubles_settled"] == found["misplaced"] == 0
    assert float(found["lost_gap_s"]) < 3.0  # type: ignore[arg-type]


def test_people_are_carried_only_while_all_are_answered_in_time() -> None:
    steps = [
        Step(measured(50), 100.0, 0.0),
        Step(measured(75), 100.0, 0.0),
        Step(measured(100, share=0.98), 100.0, 0.0),
        Step(measured(125, service_ms=14.0), 100.0, 0.0),
        Step(measured(150, client_ms=21.0), 100.0, 0.0),
    ]
    assert most_carried(steps) == 75
    assert most_carried(steps[2:]) == 0


def test_the_slope_of_memory_is_that_of_a_line_through_it() -> None:
    def health(second: int, mb: float) -> Health:
        return Health(VERSION, "s", "", second * 10**9, 0.0, 0, 0, {}, 0.0, 0.0, (), memory_bytes=int(mb * 1e6))

    line = [health(second, 200.0 + 0.5 * second) for second in range(20)]
    last_mb, slope_mb_h = memory(line)
    assert np.isclose(last_mb, 209.5)
    assert np.isclose(slope_mb_h, 1800.0)
    assert memory(line[:2]) == (200.5, 0.0)
