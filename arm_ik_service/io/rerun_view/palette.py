"""The colours that carry meaning, in the picture, in the plots and in the legend alike."""

from __future__ import annotations

from arm_ik_service.io.rerun_view.solids import Colour
from arm_ik_service.wire.messages import Side, TrackingState

SIDE_COLOURS: dict[Side, Colour] = {"left": (74, 144, 226), "right": (240, 140, 58)}  # apart for the colour-blind too
STATE_COLOURS: dict[TrackingState, Colour] = {
    "tracked": (76, 190, 120),
    "inferred": (240, 205, 70),
    "held": (226, 80, 150),
    "lost": (120, 126, 138),
}
LIMIT: Colour = (92, 44, 50)
AT_LIMIT: Colour = (255, 70, 70)
RANGE: Colour = (176, 128, 132)
COMFORT: Colour = (250, 240, 190)
FAINT: Colour = (96, 104, 118)
REACH = 22  # opacity of a reach sphere
GHOST = (235, 238, 255, 90)
NAME: Colour = (235, 238, 242)
RESIDUAL: Colour = (255, 60, 90)
LATENCY_COLOURS: tuple[Colour, Colour, Colour] = ((120, 170, 220), (170, 130, 220), (220, 220, 225))
