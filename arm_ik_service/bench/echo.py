"""The bare Zenoh echo that our own figures are held against: a Python callback that puts, and nothing else.

Run as `python -m arm_ik_service.bench.echo ENDPOINT BYTES`: what comes in on `echo/in` begins with 8 bytes that go out
again on `echo/out`, filled up to BYTES.
"""

from __future__ import annotations

import sys

from arm_ik_service.bench.processes import wait_for_end
from arm_ik_service.io.zenoh_bus import BusOptions, open_hub
from arm_ik_service.io.zenoh_streams import declare_stream, subscribe

KEY_IN, KEY_OUT = "echo/in", "echo/out"
HEADER_BYTES = 8


def main(endpoint: str, answer_bytes: int) -> None:
    """Echo until asked to end."""
    filler = bytes(answer_bytes - HEADER_BYTES)
    with open_hub(BusOptions(listen=(endpoint,))) as bus:
        stream = declare_stream(bus, KEY_OUT, "msgpack")
        subscribe(bus, KEY_IN, lambda _key, payload, _time_ns: stream.put(payload[:HEADER_BYTES] + filler))
        wait_for_end()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
