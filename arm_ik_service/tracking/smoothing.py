"""The 1 Euro filter (Casiez, Roussel & Vogel 2012), with a threshold and a leash: strong at rest, gone in motion.

The cutoff is `rest_hz` up to a speed that noise alone may show, and rises from there. In motion that makes the output
trail by 1 / (2 pi rise) metres (or radians), whatever the speed, so the delay falls as the speed rises. While the
speed is still being found out the leash holds: the output is never farther from the data than its length, nor, where a
filter says so, than some times the data's own noise, of which third differences tell: clean data is hardly touched.

Position and rotation of a device go the same part of the way to their data, the larger of what the two want. So what
is rigid stays rigid: a wrist, beside the grip, moves as smoothly as it did, where two filters apart shake it.

`light` trails by 0.4 mm and at the most by 3 mm, which at 2 m/s is 0.2 and 1.5 ms; `strong` by 5 and 20 mm, 2.5 and
10 ms. Noise of 1 mm and 0.3 degrees at rest comes out divided by 2.6 at 30 Hz and 3.8 at 90 Hz; `strong`: 3.6 and 6.
"""

from __future__ import annotations

import math
from typing import Any

from arm_ik_service.compiled import Record, compiled, inlined
from arm_ik_service.geometry import scalar as g
from arm_ik_service.geometry.scalar import Quaternion, Vector

OFF, LIGHT, STRONG = 0, 1, 2  # TrackingSettings.smoothing

SLOPE_HZ = 2.0  # cutoff of the speed estimate ...
NOISE_HZ = 0.5  # ... and of that of the noise
STARTS_FOR_S = 0.05  # after a start the estimates are of little use, and the data passes as it is
KNOWS_NOISE_FROM = 4  # samples: so many make a third difference
NOWHERE = 1e-9  # [m, rad]: a quantity that has no way to go does not hurry the other one
# rest_hz; rise [Hz per m/s, per rad/s]; threshold [m/s, rad/s]; leash [m, rad]; the same in noises (RMS of the vector)
POSITION_FILTERS = ((0.0, 0.0, 0.0, 0.0, 0.0), (1.6, 400.0, 0.06, 0.003, 2.0), (0.8, 30.0, 0.04, 0.02, math.inf))
ROTATION_FILTERS = ((0.0, 0.0, 0.0, 0.0, 0.0), (1.6, 100.0, 0.3, 0.02, 2.0), (0.8, 10.0, 0.2, 0.1, math.inf))


@compiled
def _gain(cutoff_hz: float, dt_s: float) -> float:
    return 1.0 - 1.0 / (1.0 + 2.0 * math.pi * cutoff_hz * dt_s)


@inlined
def _noise(channel: Record, dt_s: float) -> float:
    """Update and return the noise [m, rad], the RMS of its length; 0 while nothing is known of it.

    The third difference of white noise has 20 times its mean square; of a hand's own motion little is left in it.
    """
    rate, change = g.vector(channel.rate), g.vector(channel.change)
    g.store(channel.change, g.subtract(rate, g.vector(channel.rate_before)))
    g.store(channel.rate_before, rate)
    channel.samples = min(channel.samples + 1, KNOWS_NOISE_FROM)
    if channel.samples == KNOWS_NOISE_FROM:
        third = g.scale(dt_s, g.subtract(g.vector(channel.change), change))
        follow = max(_gain(NOISE_HZ, dt_s), dt_s / channel.restarted_s)
        channel.noise_squared += follow * (g.dot(third, third) / 20.0 - channel.noise_squared)
    return math.sqrt(channel.noise_squared)


@compiled
def _adaptive_gain(channel: Record, filters: Any, level: int, dt_s: float) -> float:
    """Update slope and noise; the gain to follow a sample with that is `channel.away` from the output."""
    away = g.norm(g.vector(channel.away))
    rest_hz, rise, threshold, longest, noises = filters[level]
    channel.restarted_s += dt_s
    follow = max(_gain(SLOPE_HZ, dt_s), dt_s / channel.restarted_s)  # at first the mean of what there is
    slope = g.lerp(g.vector(channel.slope), g.vector(channel.rate), follow)
    g.store(channel.slope, slope)
    if level == OFF:
        return 1.0
    noise = _noise(channel, dt_s)
    if away < NOWHERE:
        return 0.0
    leash = max(min(longest, noises * noise), NOWHERE) if noises < math.inf else longest
    gain = _gain(rest_hz + rise * max(g.norm(slope) - threshold, 0.0), dt_s)
    gain = max(gain, min(2.0 - channel.restarted_s / STARTS_FOR_S, 1.0))
    squared = ((1.0 - gain) * away / leash) ** 2
    eighth = squared * squared * squared * squared
    leashed = math.sqrt(math.sqrt(math.sqrt(1.0 + eighth)))  # no kink where the leash is taut
    return float(1.0 - (1.0 - gain) / leashed)


@compiled
def restart(channel: Record, value: Any) -> None:
    """Forget what was before `value`, which passes as it is."""
    g.store(channel.measured, value)
    g.store(channel.smooth, value)
    for tangent in (channel.away, channel.rate, channel.slope):
        g.store(tangent, (0.0, 0.0, 0.0))
    channel.noise_squared, channel.samples, channel.restarted_s = 0.0, 0, 0.0


@compiled
def note_position(channel: Record, position: Vector, since_s: float, dt_s: float, level: int) -> None:
    """Take note of a position [m] `since_s` after the last one, and of what part of the way to it the filter goes."""
    g.store(channel.rate, g.scale(1.0 / since_s, g.subtract(position, g.vector(channel.measured))))
    g.store(channel.measured, position)
    g.store(channel.away, g.subtract(position, g.vector(channel.smooth)))
    channel.gain = _adaptive_gain(channel, POSITION_FILTERS, level, dt_s)


@compiled
def note_rotation(channel: Record, rotation: Quaternion, since_s: float, dt_s: float, level: int) -> None:
    """Do the same for a rotation."""
    turned = g.log(g.multiply(rotation, g.conjugate(g.quaternion(channel.measured))))
    g.store(channel.rate, g.scale(1.0 / since_s, turned))
    g.store(channel.measured, rotation)
    g.store(channel.away, g.log(g.multiply(rotation, g.conjugate(g.quaternion(channel.smooth)))))
    channel.gain = _adaptive_gain(channel, ROTATION_FILTERS, level, dt_s)


@inlined
def smooth_position(channel: Record, gain: float) -> Vector:
    """Go a part of the way from `channel.smooth` to what was measured [m]."""
    smooth = g.subtract(g.vector(channel.measured), g.scale(1.0 - gain, g.vector(channel.away)))
    g.store(channel.smooth, smooth)
    return smooth


@inlined
def smooth_rotation(channel: Record, gain: float) -> Quaternion:
    """Go a part of the way from `channel.smooth` to the rotation that was measured."""
    back = g.exp(g.scale(gain - 1.0, g.vector(channel.away)))
    smooth = g.normalized(g.multiply(back, g.quaternion(channel.measured)))
    g.store(channel.smooth, smooth)
    return smooth
