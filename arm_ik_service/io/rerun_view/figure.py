"""The person as solids: which parts there are, in which axes each is built, how large it is.

Arms are built in ISB axes of the right side (+X anterior, +Y to the proximal end, +Z to the right), the hand in the
OpenXR wrist frame (-Z to the fingers, +Y out of its back), everything else in OpenXR axes. Girths are those of a
person of average build (ANSUR II means, rounded); they only have to look right.
"""

from __future__ import annotations

from arm_ik_service.io.rerun_view.palette import SIDE_COLOURS
from arm_ik_service.io.rerun_view.solids import Colour, Solid, capsule, join, ring, rounded_box, tube
from arm_ik_service.wire.messages import Side

SKIN: Colour = (226, 186, 160)
TROUSERS: Colour = (92, 100, 116)
SHIRT: Colour = (203, 209, 218)
HEADSET: Colour = (44, 48, 56)
VISOR: Colour = (86, 100, 120)
WHITE: Colour = (255, 255, 255)
CONTROLLER: Colour = (250, 250, 252)

HAND_M = 0.189  # the hand below is of this length, wrist to fingertip if it were straight
NECK_M = 0.12  # the neck below
GIRDLE_M = 0.15  # half the girdle below
LEG_M, FOOT_M = 0.43, 0.17  # thigh, shank and foot below


def upper_arm(side: Side, length_m: float) -> Solid:
    """Deltoid, biceps, triceps: from the glenohumeral joint down -Y."""
    n = -length_m
    right = tube(
        [
            (0.060, 0.016, 0.016, 0.0, 0.004),
            (0.052, 0.036, 0.036, 0.0, 0.004),
            (0.020, 0.056, 0.054, 0.0, 0.008),
            (0.16 * n, 0.058, 0.056, 0.0, 0.010),
            (0.34 * n, 0.052, 0.049, 0.002, 0.004),
            (0.56 * n, 0.051, 0.044, 0.004, 0.0),
            (0.80 * n, 0.043, 0.041, 0.0, 0.0),
            (0.96 * n, 0.039, 0.042, 0.0, 0.0),
            (1.00 * n - 0.026, 0.030, 0.032, 0.0, 0.0),
            (1.00 * n - 0.036, 0.012, 0.012, 0.0, 0.0),
        ],
        SIDE_COLOURS[side],
    )
    return right if side == "right" else right.mirrored(2)


def forearm(side: Side, length_m: float) -> Solid:
    """From the elbow down -Y: full below the elbow, flat at the wrist across the two bones."""
    n = -length_m
    colour = SIDE_COLOURS[side]
    right = tube(
        [
            (0.036, 0.012, 0.012, 0.0, 0.0),
            (0.028, 0.030, 0.031, 0.0, 0.0),
            (0.000, 0.041, 0.042, 0.0, 0.0),
            (0.18 * n, 0.044, 0.046, 0.0, 0.004),
            (0.36 * n, 0.042, 0.043, 0.0, 0.003),
            (0.62 * n, 0.033, 0.036, 0.0, 0.0),
            (0.84 * n, 0.025, 0.031, 0.0, 0.0),
            (0.93 * n, 0.025, 0.031, 0.0, 0.0),
            (0.94 * n, 0.018, 0.020, 0.0, 0.0),
        ],
        colour,
    )
    cuff = tube(
        [(0.86 * n, 0.027, 0.033, 0.0, 0.0), (0.94 * n, 0.027, 0.033, 0.0, 0.0)],
        (colour[0] // 2, colour[1] // 2, colour[2] // 2),
    )
    wrist = capsule((0.0, 0.90 * n, 0.0), (0.0, n, 0.0), (0.021, 0.021), SKIN)
    right = join(right, cuff, wrist)
    return right if side == "right" else right.mirrored(2)


def hand(side: Side, length_m: float) -> Solid:
    """A hand closed around a grip, thumb along it: shows the side, the palm and the pronation. White, to be tinted."""
    parts = [rounded_box((0.041, 0.015, 0.043), WHITE, roundness=0.55).moved((0.0, -0.002, -0.047))]
    bend = ((-0.34, 0.94), (0.94, 0.34), (0.82, -0.57))  # z and -y of the three phalanges: 70, 160, 215 degrees
    for x, z, phalanges, radius in (
        (-0.032, -0.084, (0.042, 0.027, 0.020), 0.0100),
        (-0.011, -0.087, (0.046, 0.030, 0.021), 0.0105),
        (0.010, -0.084, (0.042, 0.028, 0.020), 0.0100),
        (0.030, -0.076, (0.036, 0.022, 0.018), 0.0088),
    ):
        point = (x, -0.004, z)
        for (forward, down), phalanx in zip(bend, phalanges, strict=True):
            end = (x, point[1] - down * phalanx, point[2] + forward * phalanx)
            parts.append(capsule(point, end, (radius, radius * 0.95), WHITE))
            point = end
    thumb = [(-0.022, -0.008, -0.022), (-0.050, -0.018, -0.050), (-0.062, -0.024, -0.080), (-0.058, -0.026, -0.106)]
    parts += [
        capsule(a, b, (r, 0.9 * r), WHITE)
        for a, b, r in zip(thumb[:-1], thumb[1:], (0.015, 0.0125, 0.011), strict=True)
    ]
    right = join(*parts).scaled(length_m / HAND_M)
    return right if side == "right" else right.mirrored(0)


def shoulder_girdle() -> Solid:
    """Trapezius and clavicle: from the root of the neck at the origin GIRDLE_M along +Y to the shoulder, stretched."""
    return capsule((0.0, 0.0, 0.0), (0.0, GIRDLE_M, 0.0), (0.052, 0.043), SHIRT)


def torso(shoulder_width_m: float) -> Solid:
    """Chest down to the waist, from the middle between the shoulders [m]; the back is at +z."""
    w = 0.5 * shoulder_width_m
    return tube(
        [
            (0.075, 0.046, 0.044, 0.0, 0.004),
            (0.060, 0.060, 0.056, 0.0, 0.004),
            (0.035, 0.62 * w, 0.074, 0.0, 0.004),
            (0.000, 0.84 * w, 0.092, 0.0, 0.002),
            (-0.060, 0.90 * w, 0.108, 0.0, -0.002),
            (-0.140, 0.90 * w, 0.118, 0.0, -0.006),
            (-0.240, 0.84 * w, 0.108, 0.0, -0.002),
            (-0.360, 0.76 * w, 0.098, 0.0, 0.0),
            (-0.440, 0.80 * w, 0.104, 0.0, 0.0),
            (-0.470, 0.76 * w, 0.098, 0.0, 0.0),
        ],
        SHIRT,
        squareness=2.5,
    )


def neck() -> Solid:
    """A neck that stands on the origin, NECK_M tall, to be stretched along Y."""
    return tube([(NECK_M, 0.050, 0.054, 0.0, 0.0), (0.0, 0.056, 0.058, 0.0, 0.0), (-0.02, 0.06, 0.06, 0.0, 0.0)], SKIN)


def thigh() -> Solid:
    """From the hip along +Y, LEG_M long, to be stretched."""
    return tube(
        [(LEG_M, 0.056, 0.060, 0.0, 0.0), (0.5 * LEG_M, 0.070, 0.076, 0.0, 0.0), (0.0, 0.080, 0.086, 0.0, 0.0)],
        TROUSERS,
    )


def shank() -> Solid:
    """From the knee along +Y, LEG_M long, to be stretched."""
    return tube(
        [
            (LEG_M, 0.038, 0.040, 0.0, 0.0),
            (0.4 * LEG_M, 0.050, 0.056, 0.0, 0.0),
            (0.0, 0.056, 0.060, 0.0, 0.0),
            (-0.03, 0.040, 0.044, 0.0, 0.0),
        ],
        TROUSERS,
    )


def foot() -> Solid:
    """A shoe from the ankle along +Y, FOOT_M long."""
    return capsule((0.0, -0.02, 0.0), (0.0, FOOT_M, 0.0), (0.046, 0.036), HEADSET)


def head() -> Solid:
    """A head that wears a headset, in the VIEW frame: the origin between the eyes, -z forward."""
    skull = tube(
        [
            (0.122, 0.030, 0.036, 0.0, 0.092),
            (0.110, 0.056, 0.070, 0.0, 0.090),
            (0.060, 0.078, 0.099, 0.0, 0.086),
            (0.000, 0.080, 0.101, 0.0, 0.084),
            (-0.060, 0.070, 0.088, 0.0, 0.074),
            (-0.100, 0.050, 0.064, 0.0, 0.058),
            (-0.118, 0.026, 0.034, 0.0, 0.044),
        ],
        SKIN,
    )
    nose = capsule((0.0, -0.030, -0.016), (0.0, -0.046, -0.022), (0.010, 0.012), SKIN)
    box = rounded_box((0.088, 0.047, 0.042), HEADSET, roundness=0.45).moved((0.0, 0.004, -0.030))
    front = rounded_box((0.074, 0.036, 0.010), VISOR, roundness=0.4).moved((0.0, 0.004, -0.068))
    strap = tube([(0.034, 0.085, 0.106, 0.0, 0.086), (0.008, 0.085, 0.106, 0.0, 0.086)], HEADSET)
    ears = [capsule((x, -0.02, 0.088), (x, 0.004, 0.092), (0.010, 0.012), SKIN) for x in (-0.083, 0.083)]
    return join(skull, nose, box, front, strap, *ears)


def controller() -> Solid:
    """The target: a handle along the grip's z, with a ring at the thumb's end, so that its two ends differ."""
    handle = capsule((0.0, 0.0, 0.062), (0.0, 0.0, -0.062), (0.0105, 0.0125), CONTROLLER)
    return join(handle, ring(0.026, 0.005, CONTROLLER).moved((0.0, 0.0, -0.082)))
