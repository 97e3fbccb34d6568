"""What programs do on an open Zenoh session: stream states, subscribe, ask and answer, announce themselves."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import zenoh

from arm_ik_service.io.zenoh_threads import keep_thread_state
from arm_ik_service.wire.codec import MEDIA_TYPES
from arm_ik_service.wire.messages import Encoding

Bus = zenoh.Session
Stream = zenoh.Publisher
QUERY_TIMEOUT_S = 0.5


def declare_stream(bus: Bus, key: str, encoding: Encoding) -> Stream:
    """Declare a publisher for a stream of states.

    Not express, and dropped under congestion: measured, `express` loses 4 % of a burst and costs 30 us a put instead
    of 3.5; blocking lets one slow reader hold a put for seconds.
    """
    return bus.declare_publisher(
        key,
        encoding=zenoh.Encoding(MEDIA_TYPES[encoding]),
        congestion_control=zenoh.CongestionControl.DROP,
        express=False,
    )


def has_listener(stream: Stream) -> bool:
    """Whether anybody subscribes to what the stream publishes."""
    status: Any = stream.matching_status  # its type stubs say bool, the library returns an object
    return bool(getattr(status, "matching", status))


def watch_listeners(stream: Stream, see: Callable[[bool], None]) -> Any:
    """Call `see(whether anybody listens)` at once and whenever it changes, on Zenoh's network thread: store and return.

    It goes on while the stream and what is returned are held.
    """

    def changed(status: zenoh.MatchingStatus) -> None:
        see(status.matching)

    watch = stream.declare_matching_listener(zenoh.handlers.Callback(changed, indirect=False))
    if has_listener(stream):  # a listener is told of changes only
        see(True)
    return watch


def put_once(bus: Bus, key: str, payload: bytes, encoding: Encoding, *, waits: bool = True) -> None:
    """Publish something that does not come again soon: it waits for room rather than be dropped, unless told not to."""
    bus.put(
        key,
        payload,
        encoding=zenoh.Encoding(MEDIA_TYPES[encoding]),
        congestion_control=zenoh.CongestionControl.BLOCK if waits else zenoh.CongestionControl.DROP,
    )


def subscribe(bus: Bus, key: str, receive: Callable[[str, bytes, int], None]) -> zenoh.Subscriber[None]:
    """Call `receive(key, payload, receive_time_ns)` for every sample, on Zenoh's network thread: store and return."""

    def received(sample: zenoh.Sample) -> None:
        keep_thread_state()
        receive(str(sample.key_expr), sample.payload.to_bytes(), time.time_ns())

    return bus.declare_subscriber(key, zenoh.handlers.Callback(received, indirect=False))


def answer_queries(
    bus: Bus, key: str, answers: Callable[[], Iterable[tuple[str, Callable[[], bytes | None]]]], encoding: Encoding
) -> zenoh.Queryable[None]:
    """Answer queries that meet the key expression `key` with those of `answers()` whose own key is asked for.

    Only what is asked for is made: a thread of Zenoh's that makes it for everybody would hold up the poses.
    """
    form = zenoh.Encoding(MEDIA_TYPES[encoding])

    def reply(query: zenoh.Query) -> None:
        asked = query.key_expr
        for own_key, make in answers():
            if asked.intersects(zenoh.KeyExpr(own_key)):
                payload = make()
                if payload is not None:
                    query.reply(own_key, payload, encoding=form)

    return bus.declare_queryable(key, reply)


def query(bus: Bus, key: str) -> Iterator[tuple[str, bytes]]:
    """Ask for a key expression and yield each answer's key and payload; nobody there means no answer."""
    for reply in bus.get(key, timeout=QUERY_TIMEOUT_S):
        if reply.ok is not None:
            yield str(reply.ok.key_expr), reply.ok.payload.to_bytes()


def announce(bus: Bus, key: str) -> Any:
    """Declare a liveliness token: it is there exactly as long as this process is."""
    return bus.liveliness().declare_token(key)


def living(bus: Bus, key: str) -> list[str]:
    """Return the keys of the liveliness tokens there are under a key expression."""
    replies = bus.liveliness().get(key, timeout=QUERY_TIMEOUT_S)
    return [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]


def watch_liveliness(bus: Bus, key: str, see: Callable[[str, bool], None]) -> zenoh.Subscriber[None]:
    """Call `see(key, alive)` for every token there is, comes or goes, on Zenoh's network thread: store and return."""

    def received(sample: zenoh.Sample) -> None:
        see(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

    handler = zenoh.handlers.Callback(received, indirect=False)
    return bus.liveliness().declare_subscriber(key, handler, history=True)


def query_later(bus: Bus, key: str, receive: Callable[[str, bytes], None]) -> None:
    """Ask for a key expression and call `receive(key, payload)` for each answer, on Zenoh's network thread."""

    def received(reply: zenoh.Reply) -> None:
        if reply.ok is not None:
            receive(str(reply.ok.key_expr), reply.ok.payload.to_bytes())

    bus.get(key, zenoh.handlers.Callback(received, indirect=False), timeout=QUERY_TIMEOUT_S)
