"""What can be spoken, live and in files. Light: the command line reads it before it knows what is asked."""

from __future__ import annotations

from enum import StrEnum


class LiveDialect(StrEnum):
    """What is sent while it happens."""

    VMC = "vmc"
    VRCHAT = "vrchat"
    ROS2 = "ros2"
    OPENXR = "openxr"


class RosWay(StrEnum):
    """How ROS 2 listens on Zenoh."""

    BOTH = "both"
    RMW_ZENOH = "rmw_zenoh"
    ROS2DDS = "ros2dds"


class McapDialect(StrEnum):
    """Whose schemas an exported .mcap file has."""

    FOXGLOVE = "foxglove"
    ROS2 = "ros2"
    OPENXR = "openxr"


OSC_PORTS = {LiveDialect.VMC: 39539, LiveDialect.VRCHAT: 9000}
