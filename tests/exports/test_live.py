"""`arm-ik export` as a process of its own on a real bus: what arrives at the other end is what was published."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Iterator
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any

import numpy as np
import pytest
from harness import KEYS, Running, wait_for
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from postures import HANGING, RAISED, frame_of, motion, person
from pythonosc.dispatcher import Dispatcher
from pythonosc.osc_server import BlockingOSCUDPServer
from typer.testing import CliRunner

from arm_ik_service.cli import app
from arm_ik_service.errors import SettingsError
from arm_ik_service.exports import ros2
from arm_ik_service.io.zenoh_bus import BusOptions, open_client, open_hub
from arm_ik_service.io.zenoh_streams import Bus, declare_stream, subscribe
from arm_ik_service.programs.demo import free_endpoint
from arm_ik_service.programs.exporter import Exporter
from arm_ik_service.programs.sinks import VmcSink
from arm_ik_service.wire.codec import encode
from arm_ik_service.wire.messages import ArmsState, ControllerFrame

pytestmark = pytest.mark.slow  # real processes, one after the other: the default run has three minutes

Heard = SimpleQueue[tuple[str, Any]]


class OscServer:
    """python-osc's own server, keeping what it hears."""

    def __init__(self) -> None:
        self.heard: Heard = SimpleQueue()
        dispatcher = Dispatcher()
        dispatcher.set_default_handler(lambda address, *params: self.heard.put((address, params)))
        self._server = BlockingOSCUDPServer(("127.0.0.1", 0), dispatcher)
        self.port = self._server.server_address[1]
        self._thread = Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()


@pytest.fixture
def hub() -> Iterator[tuple[Bus, str]]:
    endpoint = free_endpoint()
    with open_hub(BusOptions(listen=(endpoint,))) as bus:
        yield bus, endpoint


def publish_until(bus: Bus, states: list[ArmsState], heard: Heard, count: int) -> list[tuple[str, Any]]:
    """Publish states over and over, with the frames they answer, until so much was heard."""
    arms = declare_stream(bus, KEYS.watched_arms(states[0].avatar), "msgpack")
    controllers = declare_stream(bus, KEYS.watched_controllers(states[0].avatar), "msgpack")
    end = time.monotonic() + 60.0
    while heard.qsize() < count and time.monotonic() < end:
        for state in states:
            controllers.put(encode(frame_of(state)))
            arms.put(encode(state))
            time.sleep(0.005)
    found = []
    try:
        while True:
            found.append(heard.get_nowait())
    except Empty:
        return found


def decoded(kind: str, payload: bytes) -> Any:
    schema = Schema(id=1, name=kind, encoding="ros2msg", data=ros2.definition(kind).encode())
    decoder = DecoderFactory().decoder_for("cdr", schema)
    assert decoder is not None
    return decoder(payload)


@pytest.mark.parametrize("together", [False, True])
def test_vmc_and_vrchat_receivers_hear_the_published_state(hub: tuple[Bus, str], together: bool) -> None:
    bus, endpoint = hub
    state = motion(30)[29]
    servers = {dialect: OscServer() for dialect in ("vmc", "vrchat")}
    to = {dialect: f"127.0.0.1:{server.port}" for dialect, server in servers.items()}
    if together:
        addresses = [word for dialect, address in to.items() for word in ("--to", f"{dialect}={address}")]
        programs = [Running("export", "vmc", "vrchat", "openxr", *addresses, "--connect", endpoint)]
    else:
        programs = [Running("export", dialect, "--to", to[dialect], "--connect", endpoint) for dialect in to]
    for program in programs:
        program.wait_ready()
    vmc = publish_until(bus, [state], servers["vmc"].heard, 60)
    vrchat = publish_until(bus, [state], servers["vrchat"].heard, 12)
    hmd = next(params for address, params in vmc if address == "/VMC/Ext/Hmd/Pos")
    x, y, z = state.head.position
    np.testing.assert_allclose(hmd[1:4], (x, y, -z), atol=1e-5)
    bones = {params[0] for address, params in vmc if address == "/VMC/Ext/Bone/Pos"}
    assert {
        f"{side}{bone}" for side in ("Left", "Right") for bone in ("Shoulder", "UpperArm", "LowerArm", "Hand")
    } < bones
    elbow = next(params for address, params in vrchat if address == "/tracking/trackers/2/position")
    x, y, z = state.right.bones.forearm.position
    np.testing.assert_allclose(elbow, (x, y, -z), atol=1e-5)
    for program in programs:
        assert program.end() == 0
        assert program.says("states sent of ann")
    for server in servers.values():
        server.close()


def test_ros_nodes_hear_cdr_with_the_attachment_and_see_us_in_the_graph(hub: tuple[Bus, str]) -> None:
    bus, endpoint = hub
    states = motion(5)
    topic = "/avatar_ann/joint_states"
    bridged: Heard = SimpleQueue()
    tf: Heard = SimpleQueue()
    attached: Heard = SimpleQueue()
    subscribe(bus, ros2.bridge_key(topic), lambda key, payload, _t: bridged.put((key, payload)))
    subscribe(bus, "0/tf/tf2_msgs::msg::dds_::TFMessage_/*", lambda key, payload, _t: tf.put((key, payload)))
    subscriber = bus.declare_subscriber(
        ros2.rmw_zenoh_key(topic, ros2.JOINT_STATE, 0), lambda sample: attached.put(("", sample.attachment))
    )
    program = Running("export", "ros2", "--connect", endpoint)
    program.wait_ready()
    joints = [decoded(ros2.JOINT_STATE, payload) for _, payload in publish_until(bus, states, bridged, 10)]
    by_stamp = {state.receive_time_ns: state for state in states}
    for message in joints:
        state = by_stamp[message.header.stamp.sec * 10**9 + message.header.stamp.nanosec]
        assert message.position[3] == state.left.angles.elbow_flexion
        assert message.velocity[17] == state.right.angle_rates.wrist_axial
    frames = decoded(ros2.TF_MESSAGE, tf.get_nowait()[1]).transforms
    assert {frame.child_frame_id for frame in frames} > {"avatar_ann/chest", "avatar_ann/right_hand"}
    assert len(attached.get_nowait()[1].to_bytes()) == 16 + 17 + 11 + 8 + 8 + 17
    tokens = [str(reply.ok.key_expr) for reply in bus.liveliness().get("@ros2_lv/**") if reply.ok is not None]
    assert sum("/MP/" in token for token in tokens) == 2
    assert sum("/NN/" in token for token in tokens) == 1
    subscriber.undeclare()
    assert program.end() == 0
    assert wait_for(lambda: not [*bus.liveliness().get("@ros2_lv/**")])


def test_openxr_joints_of_everybody_come_back_over_zenoh_as_in_a_mirror(hub: tuple[Bus, str]) -> None:
    bus, endpoint = hub
    heard: Heard = SimpleQueue()
    subscribe(bus, "avatar/*/xr_fb_body_tracking", lambda key, payload, _t: heard.put((key, json.loads(payload))))
    program = Running("export", "openxr", "--mirror", "--connect", endpoint)
    program.wait_ready()
    found = publish_until(bus, [person(HANGING, RAISED, avatar="ann")], heard, 3)
    found += publish_until(bus, [person(HANGING, RAISED, avatar="bob")], heard, 3)
    assert {key.split("/")[1] for key, _ in found} == {"ann", "bob"}
    for _, message in found:
        hands = {joint["name"]: joint["position"] for joint in message["joints"]}
        assert hands["XR_BODY_JOINT_LEFT_HAND_WRIST_FB"][1] > 1.8
        assert hands["XR_BODY_JOINT_LEFT_HAND_WRIST_FB"][0] < -0.1
    assert program.end() == 0


def test_a_port_where_nobody_listens_and_bytes_that_are_no_state_do_not_end_it(hub: tuple[Bus, str]) -> None:
    bus, endpoint = hub
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        nobody = probe.getsockname()[1]
    program = Running("export", "vmc", "--to", f"127.0.0.1:{nobody}", "--connect", endpoint)
    program.wait_ready()
    arms = declare_stream(bus, KEYS.watched_arms("ann"), "msgpack")
    for payload in (b"\xff\x00not ours", b"", encode(person())) * 20:
        arms.put(payload)
        time.sleep(0.01)
    assert program.popen.poll() is None
    assert program.end() == 0
    assert program.says("states sent of ann")


@pytest.mark.parametrize(
    ("arguments", "cause"),
    [
        (("vmc", "--to", "127.0.0.1:port"), "HOST:PORT"),
        (("vrchat", "--to", "127.0.0.1:65536"), "HOST:PORT"),
        (("ros2", "--to", "127.0.0.1:1"), "--connect"),
        (("vmc", "vrchat", "--to", "127.0.0.1:1"), "vmc=127.0.0.1:1"),
        (("vmc", "ros2", "--to", "ros2=127.0.0.1:1"), "not sent over OSC"),
        (("vmc", "--to", "127.0.0.1:1", "--to", "127.0.0.1:2"), "already"),
    ],
)
def test_an_address_that_cannot_be_used_is_refused_with_its_cure(arguments: tuple[str, ...], cause: str) -> None:
    result = CliRunner().invoke(app, ["export", *arguments])
    assert isinstance(result.exception, SettingsError)
    assert cause in str(result.exception)


def test_a_host_without_an_address_is_named() -> None:
    with pytest.raises(SettingsError, match=r"no\.such\.host\.invalid"):
        VmcSink("no.such.host.invalid", 39539)


class Kept:
    """A sink that keeps whom it was told of."""

    wants_frames = False

    def __init__(self, *, many: bool) -> None:
        self.many = many
        self.heard: list[str] = []

    def send(self, state: ArmsState, frame: ControllerFrame | None) -> None:
        self.heard.append(state.avatar)

    def close(self) -> None:
        pass


def test_several_people_are_not_mixed_on_a_sink_that_knows_one_beside_one_that_knows_all(hub: tuple[Bus, str]) -> None:
    bus, endpoint = hub
    one, all_of_them = Kept(many=False), Kept(many=True)
    with open_client(BusOptions(connect=(endpoint,)), wait_s=10.0) as client:
        exporter = Exporter(client, [one, all_of_them], KEYS)
        worker = Thread(target=exporter.run)
        worker.start()
        streams = {name: declare_stream(bus, KEYS.watched_arms(name), "msgpack") for name in ("ann", "bob")}
        for seq in range(200):
            for name, stream in streams.items():
                stream.put(encode(person(avatar=name, seq=seq)))
            time.sleep(0.005)
        assert wait_for(lambda: len(one.heard) > 10)
        exporter.stop()
        worker.join(5.0)
    assert len(set(one.heard)) == 1
    assert set(all_of_them.heard) == {"ann", "bob"}
