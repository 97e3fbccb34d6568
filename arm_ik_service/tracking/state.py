"""What tracking knows of one person: the head and two hands in time, and the clock they share."""

from __future__ import annotations

import numpy as np

from arm_ik_service.compiled import record_dtype

# tracking states, in the order of wire.messages.TrackingState; the worse one is the smaller one
LOST, HELD, INFERRED, TRACKED = 0, 1, 2, 3

# verdicts of step_tracking
ACCEPTED = 0
OUT_OF_ORDER = 1  # an older sample than the last accepted one: refused, nothing changed
DUPLICATE = 2  # the last accepted frame once more: refused, nothing changed
REFUSALS = {OUT_OF_ORDER: "out_of_order", DUPLICATE: "duplicate"}  # names for health

NEVER_S = 1e9  # age of data that never came


def _channel(components: int) -> np.dtype[np.void]:
    """Memory of one quantity of a device: a position (3) or a rotation (4); its tangents have three components."""
    value, tangent = (np.float64, (components,)), (np.float64, (3,))
    return record_dtype(
        [
            ("source", np.int64),  # what was followed last: TRACKED, INFERRED, or LOST for nothing yet or a pause
            ("measured", *value),  # the last sample that was followed, as it came
            ("rate", *tangent),  # from the one before to it, per second
            ("suspect", *value),  # the last sample that was not followed because no hand moves like that
            ("suspected_for_s", np.float64),  # how long such samples have agreed with each other
            ("suspects", np.int64),  # how many they are
            ("smooth", *value),  # the 1 Euro filter's
            ("away", *tangent),  # from there to the sample
            ("gain", np.float64),  # what part of the way to the sample it wants to go in this frame; 0 if there is none
            ("slope", *tangent),  # its estimate of the rate
            ("noise_squared", np.float64),  # its estimate of the data's noise, from ...
            ("rate_before", *tangent),  # ... the rate before,
            ("change", *tangent),  # and by how much that had changed
            ("samples", np.int64),  # since the filter started afresh, as far as they matter
            ("restarted_s", np.float64),  # since the filter started afresh
            ("offset", *tangent),  # what the output was away from the data when it was last re-acquired
            ("fading_s", np.float64),  # since then
            ("fades_for_s", np.float64),  # until the offset is nought
        ]
    )


DEVICE = record_dtype(
    [
        # world axes; finite and unit at all times
        ("position", np.float64, (3,)),
        ("rotation", np.float64, (4,)),
        ("linear_velocity", np.float64, (3,)),
        ("angular_velocity", np.float64, (3,)),
        ("position_state", np.int64),
        ("rotation_state", np.int64),
        ("position_age_s", np.float64),  # since the last position that was followed
        ("rotation_age_s", np.float64),
        ("turn_left", np.float64),  # [rad] that a held hand is behind the person it goes round with
        ("glitches", np.int64),  # samples not followed because no hand moves like that
        ("position_channel", _channel(3)),
        ("rotation_channel", _channel(4)),
    ]
)
CLOCK = record_dtype(
    [
        ("started", np.int64),
        ("seq", np.int64),  # of the last accepted frame
        ("period_s", np.float64),  # running estimate; stands in for an interval of nought
        ("accepted_at_ns", np.int64),  # receive time of the last accepted frame
        ("steps", np.int64),  # how often the sender's clock was found to have stepped back
    ]
)
TRACKING = record_dtype(
    [
        ("head", DEVICE),
        ("hands", DEVICE, (2,)),  # left, right
        ("sample_time_ns", np.int64),
        ("dt_s", np.float64),  # since the frame before; 0 for the first, for a repeated time, after a clock step
        ("interval_s", np.float64),  # to divide movements by: dt_s, but never so little that noise looks like speed
        ("clock", CLOCK),
        ("has_heading", np.int64),
        ("heading", np.float64),  # of the person, not of a glance; about +Y
        ("recentres", np.int64),  # how often the tracked space was found to have been moved
        ("recentred_yaw", np.float64),  # by how much in this frame, about +Y ...
        ("recentred_from", np.float64, (3,)),  # ... around this point, which then went ...
        ("recentred_to", np.float64, (3,)),  # ... here
    ]
)

# Grip poses of arms that hang at rest, fingers down, palms inwards, in axes at the head that share its yaw; from a
# standing person of 1.75 m.
HEAD_AT_REST = (0.0, 1.63, 0.0)
HANDS_AT_REST = ((-0.25, -0.87, 0.05), (0.25, -0.87, 0.05))
