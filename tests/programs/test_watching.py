"""`arm-ik top` and `arm-ik doctor`, as a person meets them."""

from __future__ import annotations

import json
import subprocess

import pytest
from harness import COMMAND, Service, standing

from arm_ik_service.programs.demo import free_endpoint
from arm_ik_service.programs.top import rows_of
from arm_ik_service.wire import codec
from arm_ik_service.wire.messages import VERSION, AvatarHealth, Health

pytestmark = pytest.mark.slow  # real processes, one after the other: the default run has three minutes


def arm_ik(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, timeout=120)


def test_top_shows_every_service_and_avatar_and_tells_a_machine_the_same(service: Service) -> None:
    service.stream("lefty").put(codec.encode(standing(0, 0)))
    assert len(service.take(1)) == 1
    shown = arm_ik("top", "--connect", service.endpoint, "--duration", "2.2")
    assert shown.returncode == 0, shown.stderr
    for text in ("under-test", "lefty", "tracked", "answered %"):
        assert text in shown.stdout
    told = json.loads(arm_ik("top", "--connect", service.endpoint, "--json").stdout)
    (health,) = told["services"]
    assert health["service"] == "under-test"
    assert [(avatar["avatar"], avatar["answered"]) for avatar in health["avatars"]] == [("lefty", 1)]
    assert health["memory_bytes"] > 10_000_000


def test_top_puts_those_who_lose_frames_first_then_those_who_lost_tracking() -> None:
    def avatar(name: str, share: float, tracking: str) -> AvatarHealth:
        return AvatarHealth(name, 72.0, 1, 0, 0, 0.0, answered_share=share, tracking=tracking)  # type: ignore[arg-type]

    people = (avatar("a", 1.0, "tracked"), avatar("b", 1.0, "held"), avatar("c", 0.5, "tracked"))
    health = Health(VERSION, "s", "", 0, 0.0, 3, 0, {}, 0.0, 0.0, people)
    assert [row.avatar.avatar for row in rows_of([health])] == ["c", "b", "a"]


def test_doctor_is_content_with_a_running_service(service: Service) -> None:
    examined = arm_ik("doctor", "--connect", service.endpoint, "--json")
    findings = {finding["what"]: finding for finding in json.loads(examined.stdout)["findings"]}
    assert findings["services"]["found"] == "under-test"
    assert findings["port"]["state"] == "well"
    assert findings["solver"]["state"] == "well"
    assert examined.returncode == 0, findings


@pytest.mark.parametrize("json_output", [[], ["--json"]])
def test_doctor_names_what_is_ill_with_its_cure_and_ends_with_1(json_output: list[str]) -> None:
    endpoint = free_endpoint()
    examined = arm_ik("doctor", "--connect", endpoint, *json_output)
    assert examined.returncode == 1
    assert endpoint.removeprefix("tcp/") in examined.stdout
    assert "arm-ik serve" in examined.stdout
