"""Sends the frames of many people, in a process of its own: to take in the answers would hold it up, and it them.

Run as `python -m arm_ik_service.bench.sender FILE AVATARS RATE_HZ FRAMES PREFIX hub|peer ENDPOINT...`. It says `ready`
once somebody listens, begins at the time [ns of the monotonic clock] in the first line of its input, and writes into
FILE, int64 (AVATARS, FRAMES), when it put each frame. It ends with its frames, or when its input does.
"""

from __future__ import annotations

import gc
import sys
import time
from pathlib import Path
from threading import Event, Thread

import numpy as np

from arm_ik_service.bench.people import moving
from arm_ik_service.bench.processes import say_ready
from arm_ik_service.io.zenoh_bus import BusOptions, open_client
from arm_ik_service.io.zenoh_streams import Bus, declare_stream, has_listener
from arm_ik_service.programs.demo import free_endpoint
from arm_ik_service.wire import codec
from arm_ik_service.wire.keys import Keys

TICK_S = 0.001  # frames that are due within it go out together: to sleep for each would load the machine itself
LISTENED_WITHIN_S = 5.0
CATCH_UP = 0.25  # of a period: after a stall frames follow no closer, or the newest would overtake the rest


def name_of(person: int) -> str:
    """Return the avatar id of person number so and so."""
    return f"person-{person:03d}"


def send(bus: Bus, put_ns: np.memmap, rate_hz: float, keys: Keys) -> None:
    """Send everybody's frames, evenly shifted within a period."""
    count, frames = put_ns.shape
    streams = [declare_stream(bus, keys.controllers(name_of(n)), "msgpack") for n in range(count)]
    codec.encode(moving(0, rate_hz))  # makes the motion
    give_up_s = time.monotonic() + LISTENED_WITHIN_S
    while not has_listener(streams[0]) and time.monotonic() < give_up_s:
        time.sleep(0.01)
    say_ready()
    start_s = int(sys.stdin.readline() or 0) / 1e9
    stopped = Event()

    def watch() -> None:
        sys.stdin.read()
        stopped.set()

    Thread(target=watch, daemon=True).start()
    period_s = 1.0 / rate_hz
    gc.collect()
    gc.disable()
    time.sleep(max(0.0, start_s - time.monotonic()))
    for seq in range(frames):
        if stopped.is_set():
            break
        payload = codec.encode(moving(seq, rate_hz))
        at_s = start_s + seq * period_s
        late_s = time.monotonic() - at_s
        if late_s > period_s:  # this machine stalled: what was missed is not sent in one burst
            start_s += late_s - CATCH_UP * period_s
            at_s = start_s + seq * period_s
        done = 0
        while done < count:
            due = min(count, 1 + int((time.monotonic() - at_s) / period_s * count))
            for row in range(done, due):
                put_ns[row, seq] = time.monotonic_ns()
                streams[row].put(payload)
            done = max(done, due)
            if done < count:
                time.sleep(TICK_S)
    put_ns.flush()
    time.sleep(0.1)  # what was put is under way


def main(file: Path, avatars: int, rate_hz: float, frames: int, prefix: str, role: str, *endpoints: str) -> None:
    """Send until it is all sent or our input ends."""
    put_ns = np.memmap(file, np.int64, mode="r+", shape=(avatars, frames))
    listen = (free_endpoint(),) if role == "peer" else ()
    with open_client(BusOptions(connect=endpoints, listen=listen), wait_s=10.0) as bus:
        send(bus, put_ns, rate_hz, Keys(prefix))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]), int(sys.argv[4]), *sys.argv[5:])
