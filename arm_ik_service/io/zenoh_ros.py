"""Publishing CDR on Zenoh for ROS 2 to read."""

from __future__ import annotations

import zenoh

from arm_ik_service.io.zenoh_streams import Bus, Stream


def declare_cdr(bus: Bus, key: str) -> Stream:
    """Declare a publisher of CDR; `put(payload, attachment=...)` takes what rmw_zenoh wants beside it.

    Dropped under congestion, as our own streams are: a pose that waits is an old pose.
    """
    return bus.declare_publisher(
        key, encoding=zenoh.Encoding.APPLICATION_CDR, congestion_control=zenoh.CongestionControl.DROP
    )


def session_id(bus: Bus) -> str:
    """Return the id of the session, which names it in rmw_zenoh's liveliness tokens."""
    return str(bus.info.zid())
