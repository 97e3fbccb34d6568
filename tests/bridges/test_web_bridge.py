"""The web bridge as a process: what it publishes, whom it refuses, what it hands back. No browser needed."""

from __future__ import annotations

import asyncio
import json
import subprocess
import time
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import pytest
from harness import COMMAND, KEYS, Running, wait_for

from arm_ik_service.io.session import open_session
from arm_ik_service.io.zenoh_streams import declare_stream
from arm_ik_service.wire.messages import ControllerFrame

pytest.importorskip("aiohttp", reason="needs the extra web")

import aiohttp
from bridges.pages import CODE, Hub, Page, Served, heard, start_web_bridge, with_page

pytestmark = pytest.mark.slow  # real processes, one after the other: the default run has three minutes


def pose(x: float, **more: Any) -> dict[str, Any]:
    return {"position": [x, 1.1, -0.3], "orientation": [0.0, 0.0, 0.0, 1.0], "flags": 15, **more}


def frame(seq: int) -> dict[str, Any]:
    return {
        "type": "frame",
        "seq": seq,
        "sample_time_ns": 1_700_000_000_000_000_000 + seq * 11_111_111,
        "space": "local_floor",
        "head": pose(0.0),
        "left": None,
        "right": pose(0.001 * seq, linear_velocity=[0.09, 0.0, 0.0]),
    }


async def pair_and_send(page: Page, count: int) -> str:
    welcome = await page.hello(code=CODE)
    for seq in range(count):
        await page.send(**frame(seq))
        await asyncio.sleep(0.002)
    return str(welcome["avatar"])


def test_every_frame_of_a_paired_page_is_published_as_it_was_sent(hub: Hub, web_bridge: Served) -> None:
    avatar = with_page(web_bridge, lambda page: pair_and_send(page, 50))
    frames = heard(hub, avatar, 50)
    assert [f.seq for f in frames] == list(range(50))
    assert [f.sample_time_ns for f in frames] == [frame(seq)["sample_time_ns"] for seq in range(50)]
    assert frames[7].space == "local_floor"
    assert frames[7].left is None
    assert frames[7].right is not None
    assert frames[7].right.position == (0.007, 1.1, -0.3)
    assert frames[7].right.linear_velocity == (0.09, 0.0, 0.0)
    assert frames[7].right.angular_velocity is None


def test_two_headsets_are_two_avatars_and_a_token_comes_back_as_the_same(hub: Hub, web_bridge: Served) -> None:
    async def welcomed(page: Page) -> Any:
        return await page.hello(code=CODE)

    one, two = with_page(web_bridge, welcomed), with_page(web_bridge, welcomed)
    assert one["avatar"] != two["avatar"]

    async def again(page: Page) -> Any:
        return await page.hello(token=one["token"])

    assert with_page(web_bridge, again)["avatar"] == one["avatar"]


def test_a_wrong_code_is_refused_and_guessing_ends_after_a_few(own_web_bridge: Served) -> None:
    async def guess(page: Page) -> Any:
        return await page.hello(code="000000")

    assert [with_page(own_web_bridge, guess) for _ in range(7)] == [4401] * 5 + [4429] * 2
    assert "5 code, 2 locked" in own_web_bridge.farewell()


OTHER_ORIGINS = ["https://evil.example", "null", "http://localhost:8443", "https://localhost:1"]


def test_a_page_from_another_origin_is_refused_before_it_can_speak(web_bridge: Served) -> None:
    async def speak(page: Page) -> Any:
        return await page.hello(code=CODE)

    for origin in OTHER_ORIGINS:
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            with_page(web_bridge, speak, origin=origin)
        assert refused.value.status == 403
    assert web_bridge.process.says(f"a page from {OTHER_ORIGINS[-1]}")


MALFORMED = {
    "noise": b"\xc1\xff\x00noise",
    "nothing": b"",
    "another shape": msgspec.msgpack.encode({"type": "frame", "seq": "seven"}),
    "an unknown kind": msgspec.msgpack.encode({"type": "launch"}),
    "a vector of two": msgspec.msgpack.encode({**frame(1), "right": {**pose(0.0), "position": [0.0, 1.0]}}),
    "a negative number": msgspec.msgpack.encode(frame(1) | {"seq": -1}),
    "nested without end": b"\x91" * 4000,
    "a second hello": msgspec.msgpack.encode({"type": "hello", "protocol": 1, "code": CODE}),
}


def test_malformed_messages_are_counted_and_drop_their_sender_and_no_other(hub: Hub, web_bridge: Served) -> None:
    async def misbehave(page: Page, payload: bytes) -> Any:
        await page.hello(code=CODE)
        await page.socket.send_bytes(payload)
        while not isinstance(answer := await page.next(), int):
            pass
        return answer

    async def with_a_bystander(page: Page) -> str:
        avatar = (await page.hello(code=CODE))["avatar"]
        for seq, payload in enumerate(MALFORMED.values()):
            bad = partial(misbehave, payload=payload)
            assert await asyncio.to_thread(with_page, web_bridge, bad) == 1008
            await page.send(**frame(seq))
        return str(avatar)

    avatar = with_page(web_bridge, with_a_bystander)
    assert len(heard(hub, avatar, len(MALFORMED))) == len(MALFORMED)
    assert web_bridge.process.says("malformed; the last: headset-")


def test_an_oversized_message_is_counted_and_drops_its_sender(web_bridge: Served) -> None:
    async def shout(page: Page) -> Any:
        await page.hello(code=CODE)
        await page.socket.send_bytes(bytes(100_000))
        return await page.next()

    assert with_page(web_bridge, shout) in (1009, 1006)  # 1006 where the rest of the message was still under way
    assert web_bridge.process.says("refused 1, too_large")


def test_text_and_silence_instead_of_a_hello_end_the_socket(web_bridge: Served) -> None:
    async def text(page: Page) -> Any:
        await page.socket.send_str("hello")
        return await page.next()

    async def frame_first(page: Page) -> Any:
        await page.send(**frame(0))
        return await page.next()

    async def old_page(page: Page) -> Any:
        await page.send(type="hello", protocol=0, code=CODE)
        return await page.next()

    assert [with_page(web_bridge, use) for use in (text, frame_first, old_page)] == [1008] * 3
    assert web_bridge.process.says("of different versions")


def test_a_ping_is_answered_with_the_bridges_time(web_bridge: Served) -> None:
    async def ping(page: Page) -> Any:
        await page.hello(code=CODE)
        before_ns = time.time_ns()
        await page.send(type="ping", page_ms=12.5)
        while (answer := await page.next())["type"] != "pong":
            pass
        return before_ns, answer, time.time_ns()

    before_ns, answer, after_ns = with_page(web_bridge, ping)
    assert answer["page_ms"] == 12.5
    assert before_ns <= answer["bridge_time_ns"] <= after_ns


def test_what_is_no_arms_state_on_the_avatars_key_never_reaches_the_page(hub: Hub, web_bridge: Served) -> None:
    async def listen(page: Page) -> Any:
        avatar = (await page.hello(code=CODE))["avatar"]
        stream = declare_stream(hub.bus, KEYS.arms(avatar), "msgpack")
        await asyncio.sleep(0.2)
        for payload in (b"noise", msgspec.msgpack.encode({"version": 99})):
            stream.put(payload)
        await asyncio.sleep(0.2)
        await page.send(type="ping", page_ms=1.0)
        return (await page.next())["type"]

    assert with_page(web_bridge, listen) == "pong"


def test_an_avatar_opened_twice_belongs_to_the_newer_window(hub: Hub, web_bridge: Served) -> None:
    async def older(page: Page) -> Any:
        welcome = await page.hello(code=CODE)

        async def newer(other: Page) -> Any:
            again = await other.hello(token=welcome["token"])
            await other.send(**frame(1))
            return again["avatar"]

        return await asyncio.gather(asyncio.to_thread(with_page, web_bridge, newer), page.next())

    avatar, code = with_page(web_bridge, older)
    assert code == 4409
    assert len(heard(hub, avatar, 1)) == 1


def test_only_the_files_of_the_page_are_served_and_nothing_may_come_from_elsewhere(web_bridge: Served) -> None:
    async def fetch(path: str) -> Any:
        async with aiohttp.ClientSession() as session, session.get(web_bridge.origin + path, ssl=False) as answer:
            return answer.status, answer.headers, await answer.text()

    status, headers, text = asyncio.run(fetch("/"))
    assert status == 200
    assert headers["Content-Type"] == "text/html; charset=utf-8"
    assert "default-src 'self'" in headers["Content-Security-Policy"]
    assert "http://" not in text.replace("http://www.w3.org", "")
    for path in ("/app.js", "/style.css", "/icon.svg"):
        assert asyncio.run(fetch(path))[0] == 200
    for path in ("/..%2fserver.py", "/server.py", "/page", "/../conftest.py", "/app.js/"):
        assert asyncio.run(fetch(path))[0] == 404


def test_the_page_names_no_other_host() -> None:
    from arm_ik_service.bridges.web.server import _page_files

    for name, (content, _) in _page_files().items():
        text = content.decode().replace("http://www.w3.org/2000/svg", "")
        assert "http://" not in text, name
        assert text.count("https://") == 0, name


def test_what_it_publishes_is_recorded_and_replayed_identically(hub: Hub, web_bridge: Served, tmp_path: Path) -> None:
    log = tmp_path / "web.mcap"
    recorder = Running("record", str(log), "--connect", hub.endpoint)
    time.sleep(1.2)
    avatar = with_page(web_bridge, lambda page: pair_and_send(page, 60))
    sent = heard(hub, avatar, 60)
    assert recorder.end() == 0
    assert [r.frame for r in open_session(log).frames()] == sent
    played = subprocess.run(
        [*COMMAND, "replay", str(log), "--avatar", "again", "--json", "--connect", hub.endpoint],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert json.loads(played.stdout)["frames"] == 60
    assert [_without_put(f) for f in heard(hub, "again", 60)] == [_without_put(f) for f in sent]


def _without_put(frame: ControllerFrame) -> Any:
    return frame.seq, frame.sample_time_ns, frame.space, frame.head, frame.left, frame.right


def test_a_bridge_that_is_killed_comes_back_for_the_same_headset(
    hub: Hub, own_web_bridge: Served, tmp_path: Path
) -> None:
    async def welcomed(page: Page) -> Any:
        return await page.hello(code=CODE)

    before = with_page(own_web_bridge, welcomed)
    own_web_bridge.process.popen.kill()
    own_web_bridge.process.popen.wait()
    after = start_web_bridge(hub.endpoint, tmp_path / "state", own_web_bridge.port)
    try:

        async def again(page: Page) -> Any:
            return await page.hello(token=before["token"])

        assert with_page(after, again)["avatar"] == before["avatar"]
    finally:
        after.farewell()


def test_a_port_in_use_and_an_empty_code_end_with_one_line(hub: Hub, web_bridge: Served, tmp_path: Path) -> None:
    for arguments, named in ((["--port", str(web_bridge.port)], str(web_bridge.port)), (["--code", " "], "--code")):
        second = Running("bridge", "web", *arguments, "--state", str(tmp_path / "state"), "--connect", hub.endpoint)
        assert second.finish() == 2
        assert len(second.lines) == 1
        assert named in second.lines[0]


def test_a_signal_ends_it_while_headsets_are_connected(own_web_bridge: Served) -> None:
    async def stay(page: Page) -> Any:
        await page.hello(code=CODE)
        own_web_bridge.process.popen.terminate()
        return await page.next()

    assert with_page(own_web_bridge, stay) == 1012
    assert own_web_bridge.process.finish() == 0
    assert wait_for(lambda: any("published 0 frames" in line for line in own_web_bridge.process.lines))
