"""A bus without a service, and the web bridge on it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from bridges.pages import Hub, Served, start_web_bridge
from harness import KEYS

from arm_ik_service.io.zenoh_bus import BusOptions, open_hub
from arm_ik_service.io.zenoh_streams import subscribe
from arm_ik_service.programs.demo import free_endpoint


@pytest.fixture(scope="module")
def hub() -> Iterator[Hub]:
    endpoint = free_endpoint()
    with open_hub(BusOptions(listen=(endpoint,))) as bus:
        heard = Hub(endpoint, bus)
        subscribe(bus, KEYS.controllers(), heard.receive)
        yield heard


@pytest.fixture(scope="module")
def web_bridge(hub: Hub, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """A bridge that all tests of a module share: every page is an avatar of its own."""
    yield from running_bridge(hub, tmp_path_factory.mktemp("state"))


@pytest.fixture
def own_web_bridge(hub: Hub, tmp_path: Path) -> Iterator[Served]:
    """A bridge that a test may spoil; it keeps its papers in `tmp_path / "state"`."""
    yield from running_bridge(hub, tmp_path / "state")


def running_bridge(hub: Hub, state: Path) -> Iterator[Served]:
    pytest.importorskip("aiohttp", reason="needs the extra web")
    served = start_web_bridge(hub.endpoint, state)
    yield served
    if served.process.popen.poll() is None:
        served.process.popen.kill()
    served.process.popen.wait()
