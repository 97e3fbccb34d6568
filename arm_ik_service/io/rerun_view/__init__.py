"""The Rerun view: both arms as solids, the poses asked for, and every number over time. The only importer of Rerun.

RerunView             takes messages, writes to sinks
LiveView              the same behind a thread: never waits, drops the oldest
write_recording       a solved session as an .rrd
write_picture         a moment of an .rrd as a .png, without a display
Save Spawn Connect Web   where a view can go
Overlay OVERLAYS      what can be drawn of an arm beside it, to explain it
Arm                   poses and angles of one arm over frames, for whoever works out where its elbow is comfortable
Skin                  a skinned character to draw people as, instead of solids
"""

from arm_ik_service.io.rerun_view.gauges import Arm
from arm_ik_service.io.rerun_view.live import LiveView
from arm_ik_service.io.rerun_view.overlays import OVERLAYS, Overlay
from arm_ik_service.io.rerun_view.picture import write_picture
from arm_ik_service.io.rerun_view.sinks import Connect, Save, Sink, Spawn, Web, has_display
from arm_ik_service.io.rerun_view.skinned import Skin
from arm_ik_service.io.rerun_view.view import RerunView, write_recording

__all__ = [
    "OVERLAYS",
    "Arm",
    "Connect",
    "LiveView",
    "Overlay",
    "RerunView",
    "Save",
    "Sink",
    "Skin",
    "Spawn",
    "Web",
    "has_display",
    "write_picture",
    "write_recording",
]
