"""Back to good data at a bounded speed, then exactly: what the output was away fades to nought over a stated time."""

from __future__ import annotations

from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.scalar import Vector

SHORTEST_FADE_S = 0.04


@compiled
def start_fading(channel: Record, offset: Vector, fastest: float) -> None:
    """Begin from `offset` [m or rad]; it never changes faster than `fastest` [m/s or rad/s]."""
    g.store(channel.offset, offset)
    channel.fading_s = 0.0
    channel.fades_for_s = max(1.5 * g.norm(offset) / fastest, SHORTEST_FADE_S)  # 1.5: the steepest of a smoothstep


@compiled
def fading_offset(channel: Record, elapsed_s: float) -> Vector:
    """Return what is left of the offset `elapsed_s` later."""
    if channel.fading_s >= channel.fades_for_s:
        return (0.0, 0.0, 0.0)
    channel.fading_s += elapsed_s
    return g.scale(1.0 - g.smoothstep(channel.fading_s / channel.fades_for_s), g.vector(channel.offset))
