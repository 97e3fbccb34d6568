"""The page in a real Chromium, with an emulated headset, against a real bridge and a real service."""

from __future__ import annotations

import base64
import contextlib
import http.server
import math
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from bridges.browser import Browser, Tab, running_browser
from bridges.pages import CODE, Served, start_web_bridge
from harness import KEYS, Running, wait_for

from arm_ik_service.geometry import batch
from arm_ik_service.io.zenoh_bus import BusOptions, open_client
from arm_ik_service.io.zenoh_streams import subscribe
from arm_ik_service.programs.demo import free_endpoint
from arm_ik_service.wire import codec
from arm_ik_service.wire.messages import FULLY_TRACKED, ArmsState, ControllerFrame, TrackedPose

pytestmark = pytest.mark.browser

RECOVERS_WITHIN_S = 2.0


@dataclass
class World:
    """A service, a bridge, and an ear on what passes between them."""

    endpoint: str
    state: Path
    service: Running
    bridge: Served
    frames: dict[str, list[ControllerFrame]] = field(default_factory=dict)
    answers: dict[str, list[ArmsState]] = field(default_factory=dict)

    def restart_service(self) -> None:
        self.service = Running("serve", "--listen", self.endpoint)
        self.service.wait_ready()

    def restart_bridge(self) -> None:
        self.bridge = start_web_bridge(self.endpoint, self.state, self.bridge.port)

    def receive_frame(self, key: str, payload: bytes, _time_ns: int) -> None:
        self.frames.setdefault(KEYS.avatar_of(key), []).append(codec.controller_frames.decode(payload))

    def receive_arms(self, key: str, payload: bytes, _time_ns: int) -> None:
        self.answers.setdefault(KEYS.avatar_of(key), []).append(codec.arms_states.decode(payload))


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with running_browser() as started:
        yield started


@pytest.fixture(scope="module")
def world(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    endpoint, state = free_endpoint(), tmp_path_factory.mktemp("papers")
    service = Running("serve", "--listen", endpoint)
    service.wait_ready()
    made = World(endpoint, state, service, start_web_bridge(endpoint, state))
    try:
        with open_client(BusOptions(connect=(endpoint,)), wait_s=10.0) as bus:
            subscribe(bus, KEYS.controllers(), made.receive_frame)
            subscribe(bus, KEYS.arms(), made.receive_arms)
            yield made
    finally:
        ended = [process.end() for process in (made.bridge.process, made.service)]
    assert ended == [0, 0], (made.bridge.process.lines, made.service.lines)


@pytest.fixture
def desktop(browser: Browser, world: World) -> Iterator[Tab]:
    """The page without a headset, answered by the service."""
    tab = browser.open(world.bridge)
    assert tab.until("armIk.latency.count > 0 && armIk.drawn.seq !== null")
    yield tab
    assert tab.errors == []
    tab.page.context.close()


@pytest.fixture
def headset(browser: Browser, world: World) -> Iterator[Tab]:
    """The page in VR on an emulated headset, answered by the service."""
    tab = browser.open(world.bridge, headset=True)
    assert tab.until("armIk.link.state === 'open' && !document.getElementById('enter').disabled")
    tab.page.click("#enter")
    assert tab.until("armIk.drawn.seq !== null && Object.keys(armIk.poses.aims).length === 2")
    yield tab
    assert tab.errors == []
    tab.page.context.close()


ALONG_A_PATH = """async ({ steps }) => {
  const { right, left } = device.controllers;
  const path = [];
  const begin = armIk.poses;
  await new Promise((done) => {
    function step() {
      const s = path.length / steps;
      const q = [Math.sin(0.4 * s), 0.3 * Math.sin(2 * s), 0.2 * s, 1];
      const n = Math.hypot(...q);
      const position = [0.2 + 0.15 * Math.sin(5 * s), 1.1 + 0.2 * s, -0.35 + 0.1 * Math.cos(7 * s)];
      const point = { position, orientation: q.map((part) => part / n) };
      right.position.set(...point.position);
      right.quaternion.set(...point.orientation);
      path.push(point);
      if (path.length < steps) device.activeSession.requestAnimationFrame(step);
      else device.activeSession.requestAnimationFrame(() => device.activeSession.requestAnimationFrame(done));
    }
    device.activeSession.requestAnimationFrame(step);
  });
  return { path, grip: Array.from(IWER.metaQuest3.controllerConfig.layout.right.gripOffsetMatrix) };
}"""


def test_controllers_moved_along_a_known_path_arrive_as_that_path_frame_by_frame(world: World, headset: Tab) -> None:
    steps = 60
    driven = headset.page.evaluate(ALONG_A_PATH, {"steps": steps})
    offset = np.array(driven["grip"]).reshape(4, 4).T  # targetRay from grip, column-major
    expected = []
    for point in driven["path"]:
        q = np.array(point["orientation"])
        position = np.array(point["position"]) + batch.rotate(q, offset[:3, 3])
        expected.append([*position, *batch.multiply(q, batch.from_matrix(offset[:3, :3]))])
    wanted = np.array(expected)

    frames = list(world.frames[headset.avatar])
    grips = np.array([[*f.right.position, *f.right.orientation] for f in frames if f.right is not None])
    distance = np.linalg.norm(grips[:, None, :3] - wanted[None, :, :3], axis=2)
    found = np.argmin(distance, axis=0)  # for each point of the path the frame that shows it
    assert distance[found, np.arange(steps)].max() < 1e-4
    turns = batch.angle_between(grips[found, 3:], wanted[:, 3:])
    assert turns.max() < 1e-3  # the emulator's own matrices are of single precision
    assert np.abs(np.abs(np.sum(grips[found, 3:] * wanted[:, 3:], axis=1)) - 1.0).max() < 1e-6
    # at the page's frame rate: one frame a point, none skipped, none twice
    assert np.array_equal(np.diff(found), np.ones(steps - 1))
    assert {right_of(frames[k]).flags for k in found} == {FULLY_TRACKED}
    times = np.array([frames[k].sample_time_ns for k in found])
    assert (np.diff(times) > 0).all()
    assert [frames[k].seq for k in found] == list(range(frames[found[0]].seq, frames[found[0]].seq + steps))


def right_of(frame: ControllerFrame) -> TrackedPose:
    assert frame.right is not None
    return frame.right


def newest(world: World, tab: Tab) -> ControllerFrame:
    return world.frames[tab.avatar][-1]


def test_head_and_left_hand_go_out_too_in_the_floor_space(world: World, headset: Tab) -> None:
    headset.run("device.position.set(0.1, 1.7, 0.05)")
    assert wait_for(lambda: head_of(newest(world, headset)).position == pytest.approx((0.1, 1.7, 0.05), abs=1e-6))
    frame = newest(world, headset)
    assert frame.space == "local_floor"
    assert frame.left is not None
    assert frame.left.position[0] < 0.0


def head_of(frame: ControllerFrame) -> TrackedPose:
    assert frame.head is not None
    return frame.head


def test_an_emulated_position_goes_out_as_inferred(world: World, headset: Tab) -> None:
    headset.run("emulated = true")
    assert wait_for(lambda: (hand := newest(world, headset).right) is not None and hand.flags == 0b0111)


def test_bare_hands_go_out_by_their_wrists(world: World, headset: Tab) -> None:
    headset.run("device.primaryInputMode = 'hand'")
    assert headset.until("armIk.poses.devices.right?.joint === 'wrist'")
    wrist = headset.run("armIk.poses.devices.right.position")
    lever_m = np.hypot(0.02, 0.075)  # of the default grip offset
    assert wait_for(
        lambda: math.dist(right_of(newest(world, headset)).position, wrist) == pytest.approx(lever_m, abs=1e-6)
    )
    assert headset.until("document.getElementById('right').textContent.includes('hand')")


DRAWN = """() => {
  const { seq, parts } = armIk.drawn;
  const places = {};
  for (const { name, matrix } of parts) places[name] = Array.from(matrix);
  return { seq, places };
}"""


@pytest.mark.parametrize("where", ["desktop", "headset"])
def test_the_drawn_wrists_and_elbows_are_where_the_service_said(
    world: World, where: str, request: pytest.FixtureRequest
) -> None:
    tab: Tab = request.getfixturevalue(where)
    for _ in range(5):
        drawn = tab.page.evaluate(DRAWN)
        assert wait_for(lambda drawn=drawn: any(a.seq == drawn["seq"] for a in world.answers[tab.avatar]))  # type: ignore[misc]
        said = next(answer for answer in world.answers[tab.avatar] if answer.seq == drawn["seq"])
        for side, arm in (("left", said.left), ("right", said.right)):
            for part, bone in (
                ("upper_arm", arm.bones.upper_arm),
                ("forearm", arm.bones.forearm),
                ("hand", arm.bones.hand),
            ):
                matrix = np.array(drawn["places"][f"{side} {part}"]).reshape(4, 4).T
                assert matrix[:3, 3] == pytest.approx(bone.position, abs=1e-6)
                assert matrix[:3, :3] == pytest.approx(batch.matrix(bone.orientation), abs=1e-6)


PIXELS = """() => new Promise((done) => requestAnimationFrame(() => {
  const scene = document.getElementById('scene');
  const copy = new OffscreenCanvas(scene.width, scene.height).getContext('2d');
  copy.drawImage(scene, 0, 0);
  const found = {};
  for (const { name, matrix } of armIk.drawn.parts) {
    const place = armIk.camera.project([matrix[12], matrix[13], matrix[14]]);
    const [x, y] = [place[0] * scene.width / scene.clientWidth, place[1] * scene.height / scene.clientHeight];
    found[name] = Array.from(copy.getImageData(Math.round(x), Math.round(y), 1, 1).data).slice(0, 3);
  }
  done(found);
}))"""


def test_the_pixels_at_the_elbows_are_of_the_colours_of_their_arms(desktop: Tab) -> None:
    pixels = desktop.page.evaluate(PIXELS)
    r, g, b = pixels["left forearm"]
    assert b > 1.2 * r, pixels  # the left arm is blue
    assert b > g
    r, g, b = pixels["right forearm"]
    assert r > 1.3 * b, pixels  # the right arm is orange
    assert r > g


def test_hands_can_be_dragged_and_driven_by_keys(world: World, desktop: Tab) -> None:
    def place(side: str) -> Any:
        return np.array(desktop.run(f"armIk.desktop.hands.{side}.position"))

    before = {side: place(side) for side in ("left", "right")}
    x, y = desktop.run("armIk.camera.project(armIk.desktop.hands.right.position)")
    desktop.page.mouse.move(x, y)
    desktop.page.mouse.down()
    desktop.page.mouse.move(x, y - 40, steps=4)
    desktop.page.mouse.up()
    assert place("right")[1] > before["right"][1] + 0.05
    assert place("left") == pytest.approx(before["left"])
    desktop.page.keyboard.down("e")
    assert desktop.until(f"armIk.desktop.hands.left.position[1] > {before['left'][1]} + 0.05")
    desktop.page.keyboard.up("e")
    raised = place("left")
    assert wait_for(lambda: hand_of(newest(world, desktop)).position == pytest.approx(tuple(raised), abs=0.02))


def hand_of(frame: ControllerFrame) -> TrackedPose:
    assert frame.left is not None
    return frame.left


def test_latency_rate_and_clock_are_shown(desktop: Tab) -> None:
    assert desktop.until("armIk.latency.count > 60", 20.0)
    assert desktop.until("/^[0-9.]+ ms, p99 [0-9.]+ ms$/.test(document.getElementById('latency').textContent)")
    assert "ms" in desktop.text("clock")
    assert desktop.until("/^[0-9]+ Hz/.test(document.getElementById('frames').textContent)")
    # page and bridge share this machine's clock: the estimate is right to half the round trip
    offset_ms = desktop.run("Number(armIk.link.clock.best.offsetNs) / 1e6 - performance.timeOrigin")
    assert abs(offset_ms) < desktop.run("armIk.link.clock.best.roundTripMs / 2") + 1.0


def test_a_controller_that_disconnects_comes_back(world: World, headset: Tab) -> None:
    headset.run("device.controllers.right.connected = false")
    assert wait_for(lambda: newest(world, headset).right is None)
    assert headset.until("document.getElementById('right').textContent.includes('no controller')")
    headset.run("device.controllers.right.connected = true")
    assert wait_for(lambda: newest(world, headset).right is not None, RECOVERS_WITHIN_S)
    assert headset.until("document.getElementById('right').textContent === 'tracked, controller'", RECOVERS_WITHIN_S)


def seqs_after(world: World, avatar: str, seq: int) -> list[int]:
    return [frame.seq for frame in world.frames[avatar] if frame.seq > seq]


def test_a_cut_socket_is_reopened_for_the_same_avatar(world: World, desktop: Tab) -> None:
    avatar, before = desktop.avatar, newest(world, desktop).seq
    desktop.run("sockets.at(-1).close()")
    assert desktop.until(f"sockets.length > 1 && armIk.arms.seq > {before} + 3", RECOVERS_WITHIN_S)
    assert desktop.avatar == avatar
    after = seqs_after(world, avatar, before)
    assert after == list(range(after[0], after[0] + len(after)))  # only frames in between can be lost


def test_a_killed_bridge_is_found_again_once_it_is_back(world: World, desktop: Tab) -> None:
    avatar, before = desktop.avatar, newest(world, desktop).seq
    world.bridge.process.popen.kill()
    world.bridge.process.popen.wait()
    assert desktop.until("document.getElementById('bridge').textContent.startsWith('reconnecting')")
    world.restart_bridge()
    assert desktop.until(f"armIk.link.state === 'open' && armIk.arms.seq > {before} + 3", RECOVERS_WITHIN_S)
    assert desktop.avatar == avatar


def test_a_killed_service_is_found_again_once_it_is_back(world: World, desktop: Tab) -> None:
    world.service.popen.kill()
    world.service.popen.wait()
    assert desktop.until("document.getElementById('service').textContent === 'does not answer'")
    world.restart_service()
    sent = newest(world, desktop).seq
    assert desktop.until(f"armIk.arms.seq > {sent}", RECOVERS_WITHIN_S)
    assert desktop.until("document.getElementById('service').textContent === 'answering'", RECOVERS_WITHIN_S)


def test_a_page_with_a_wrong_code_is_refused_and_may_try_again(browser: Browser, world: World) -> None:
    tab = browser.open(world.bridge, code="000000")
    assert tab.until("document.getElementById('pairing').open && armIk.link.state === 'unpaired'")
    assert tab.until("document.getElementById('pairing-error').textContent === 'wrong code'")
    assert tab.run("armIk.link.avatar") is None
    tab.page.fill("#code", CODE)
    tab.page.press("#code", "Enter")
    assert tab.until("armIk.link.state === 'open' && !document.getElementById('pairing').open")
    tab.page.context.close()


@contextlib.contextmanager
def another_site() -> Iterator[str]:
    class Quiet(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.end_headers()
            self.wfile.write(b"<!doctype html><title>another site</title>")

        def log_message(self, *_: Any) -> None:
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Quiet)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_address[1]}/"
    server.shutdown()


def test_a_page_of_another_site_cannot_open_the_socket(browser: Browser, world: World) -> None:
    with another_site() as url:
        tab = browser.open_elsewhere(url)
        outcome = tab.run(
            f"""new Promise((done) => {{
              const socket = new WebSocket('wss://localhost:{world.bridge.port}/socket');
              socket.onopen = () => done('open');
              socket.onclose = ({{ code }}) => done(code);
            }})"""
        )
        assert outcome == 1006
        assert world.bridge.process.says(f"a page from {url.rstrip('/')}")
        tab.page.context.close()


def test_two_headsets_are_two_avatars_at_once(world: World, desktop: Tab, headset: Tab) -> None:
    assert desktop.avatar != headset.avatar
    for tab in (desktop, headset):
        before = tab.run("armIk.arms.seq")
        assert tab.until(f"armIk.arms.seq > {before} + 5")
        assert tab.run("armIk.arms.avatar") == tab.avatar


VALUES: list[Any] = [
    None,
    True,
    False,
    *(
        sign * (2**power + more)
        for sign in (1, -1)
        for power in (0, 5, 7, 8, 15, 16, 31, 32, 52)
        for more in (-1, 0, 1)
    ),
    1_700_000_000_123_456_789,
    -(2**62),
    0.1,
    -1e300,
    "",
    "ä" * 40,
    "x" * 700,
    [],
    list(range(20)),
    {f"key {n}": [n, {"deep": [None, -0.5]}] for n in range(20)},
]


def test_the_pages_messagepack_is_everybodys(desktop: Tab) -> None:
    given = base64.b64encode(msgspec.msgpack.encode(VALUES)).decode()
    returned = desktop.page.evaluate(
        """async (given) => {
          const { decode, encode } = await import('/msgpack.js');
          const bytes = encode(decode(Uint8Array.from(atob(given), (c) => c.charCodeAt(0)).buffer));
          return Array.from(bytes);
        }""",
        given,
    )
    assert msgspec.msgpack.decode(bytes(returned)) == VALUES


def test_the_pages_clock_follows_the_bridges_without_a_step_unless_it_was_set(desktop: Tab) -> None:
    """Pings that find the bridge 5 ms later, then a second later, than the first ones did."""
    first, slewed, jumped = desktop.page.evaluate(
        """async () => {
          const { BridgeClock } = await import('/clock.js');
          const clock = new BridgeClock();
          const asked = (fromMs, shiftMs) => Array.from({ length: 200 }, (_, k) => {
            const nowMs = fromMs + 10 * k;
            if (k % 10 === 0) clock.add(nowMs - 1, nowMs + 1, BigInt((nowMs + shiftMs) * 1e6));
            return Number(clock.toBridgeNs(nowMs)) / 1e6;
          });
          return [asked(0, 1000), asked(2000, 1005), asked(4000, 2000)];
        }"""
    )
    assert first == [1000 + 10 * k for k in range(200)]
    steps = np.diff([first[-1], *slewed])
    assert np.all(np.abs(steps - 10.0) <= 10.0 * 0.0005 + 1e-6)
    assert slewed[-1] > 4990 + 0.2  # on its way
    assert jumped[-1] == 4000 + 1990 + 2000
