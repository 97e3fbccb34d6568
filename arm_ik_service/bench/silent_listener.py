"""A process that hears the arms and does nothing with them: what every listener costs, whatever it is for.

Run as `python -m arm_ik_service.bench.silent_listener ENDPOINT KEY...`.
"""

from __future__ import annotations

import sys

from arm_ik_service.bench.processes import wait_for_end
from arm_ik_service.io.zenoh_bus import BusOptions, open_client
from arm_ik_service.io.zenoh_streams import subscribe


def main(endpoint: str, keys: list[str]) -> None:
    """Listen until asked to end."""
    with open_client(BusOptions(connect=(endpoint,)), wait_s=5.0) as bus:
        for key in keys:
            subscribe(bus, key, lambda _key, _payload, _time_ns: None)
        wait_for_end()


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
