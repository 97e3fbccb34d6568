"""The 1 Euro filter (Casiez, Roussel & Vogel 2012), with a threshold and a leash: strong at rest, gone in motion.

The cutoff is `rest_hz` up to a speed that noise alone may show, and rises from there. In motion that makes the output
trail by 1 / (2 pi rise) metres (or radians), whatever the speed, so the delay falls as the speed rises. While the
speed is still being found out the leash holds: the output is never farther from the data than its length.

`light` trails by 0.4 mm and at the most by 3 mm, which at 2 m/s is 0.2 and 1.5 ms; `strong` by 5 and 20 mm, 2.5 and
10 ms. Noise of 1 mm and 0.3 degrees at rest comes out divided by 2.6 at 30 Hz and 4 at 90 Hz; `strong`: 3.6 and 6.
"""

from __future__ import annotations

import math
from typing import Any

from arm_ik_service.compiled import Record, compiled
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.scalar import Quaternion, Vector

OFF, LIGHT, STRONG = 0, 1, 2  # TrackingSettings.smoothing

SLOPE_HZ = 2.0  # cutoff of the speed estimate
STARTS_FOR_S = 0.05  # after a start the estimate is of little use, and the data passes as it is
# rest_hz; rise [Hz per m/s, per rad/s]; threshold [m/s, rad/s]; leash [m, rad]
POSITION_FILTERS = ((0.0, 0.0, 0.0, 0.0), (1.6, 400.0, 0.06, 0.003), (0.8, 30.0, 0.04, 0.02))
ROTATION_FILTERS = ((0.0, 0.0, 0.0, 0.0), (1.6, 100.0, 0.3, 0.02), (0.8, 10.0, 0.2, 0.1))


@compiled
def _gain(cutoff_hz: float, dt_s: float) -> float:
    return 1.0 - 1.0 / (1.0 + 2.0 * math.pi * cutoff_hz * dt_s)


@compiled
def _adaptive_gain(channel: Record, filters: Any, level: int, away: float, dt_s: float) -> float:
    """Update the slope; the gain to follow a sample with that is `away` [m, rad] from the output."""
    rest_hz, rise, threshold, leash = filters[level]
    channel.restarted_s += dt_s
    follow = max(_gain(SLOPE_HZ, dt_s), dt_s / channel.restarted_s)  # at first the mean of what there is
    slope = g.lerp(g.vector(channel.slope), g.vector(channel.rate), follow)
    g.store(channel.slope, slope)
    if level == OFF:
        return 1.0
    gain = _gain(rest_hz + rise * max(g.norm(slope) - threshold, 0.0), dt_s)
    gain = max(gain, min(2.0 - channel.restarted_s / STARTS_FOR_S, 1.0))
    squared = ((1.0 - gain) * away / leash) ** 2
    eighth = squared * squared * squared * squared
    leashed = math.sqrt(math.sqrt(math.sqrt(1.0 + eighth)))  # no kink where the leash is taut
    return float(1.0 - (1.0 - gain) / leashed)


@compiled
def restart(channel: Record, value: Any) -> None:
    """Forget what was before `value`."""
    g.store(channel.smooth, value)
    g.store(channel.slope, (0.0, 0.0, 0.0))
    channel.restarted_s = 0.0


@compiled
def smooth_position(channel: Record, position: Vector, dt_s: float, level: int) -> None:
    """Filter one position [m] into `channel.smooth`."""
    away = g.subtract(position, g.vector(channel.smooth))
    gain = _adaptive_gain(channel, POSITION_FILTERS, level, g.norm(away), dt_s)
    g.store(channel.smooth, g.subtract(position, g.scale(1.0 - gain, away)))


@compiled
def smooth_rotation(channel: Record, rotation: Quaternion, dt_s: float, level: int) -> None:
    """Filter one rotation into `channel.smooth`."""
    away = g.log(g.multiply(rotation, g.conjugate(g.quaternion(channel.smooth))))
    gain = _adaptive_gain(channel, ROTATION_FILTERS, level, g.norm(away), dt_s)
    g.store(channel.smooth, g.normalized(g.multiply(g.exp(g.scale(gain - 1.0, away)), rotation)))
