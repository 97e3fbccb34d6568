"""The kinematic arm: `models/human_arm.xml` read by Pinocchio, scaled to a person, and flattened for compiled code."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from arm_ik_service.arm.chain import CHAIN, columns_of, forward_poses
from arm_ik_service.arm.configuration import clamped, read_configuration, store_configuration
from arm_ik_service.arm.limits import octant, swing_excess, twist_excess, twist_of
from arm_ik_service.compiled import compiled
from arm_ik_service.errors import ModelError
from arm_ik_service.geometry.batch import log, rotate
from arm_ik_service.geometry.scalar import scale
from arm_ik_service.resources import resource_folder
from arm_ik_service.wire.messages import SIDES, Side

Array = npt.NDArray[np.float64]

HINGES = ("elbow_flexion", "elbow_carrying", "pronation", "wrist_flexion", "wrist_deviation", "wrist_axial")
ANGLES = ("shoulder_flexion", "shoulder_abduction", "shoulder_twist", *HINGES)
# Bit i of a limits mask is LIMITS[i]. The last one is of velocity: some joint's speed limit scaled all of them.
LIMITS = ("shoulder_swing", "shoulder_twist", *HINGES, "joint_speed")

_HINGE_TYPES = ["JointModelRZ", "JointModelRX", "JointModelRY"]
_TOLERANCE = 1e-9
_HAND_OF_MODEL_M = 0.189  # wrist to fingertip of the person the file is written for


class ArmModel:
    """One arm of one person. Build with `load`; frozen from then on.

    Configurations are Pinocchio's: shoulder quaternion x y z w, then HINGES [rad]; (10,). Velocities (9,) are in
    tangent order: the humerus' angular velocity in its own axes, then the hinge rates [rad/s]. A left arm's
    configuration is that of the mirrored, right arm: equal signs mean equal anatomy on both sides.
    """

    def __init__(self, model: Any, chain: npt.NDArray[Any], side: Side) -> None:
        self.side: Side = side
        self.pinocchio = model  # the right arm in the shoulder frame; a left one's targets are mirrored before it
        self.chains = chain  # array of one CHAIN record, as compiled code takes it
        self.upper_arm_m = float(chain[0].upper_arm_m)
        self.forearm_m = float(chain[0].forearm_m)
        self.hand_frame_id = int(model.getFrameId("hand", pin.FrameType.OP_FRAME))

    @classmethod
    def load(
        cls,
        side: Side = "right",
        upper_arm_m: float | None = None,
        forearm_m: float | None = None,
        hand_m: float | None = None,
        *,
        limits: Mapping[str, tuple[float, float]] | None = None,
        path: Path | None = None,
    ) -> ArmModel:
        """Read the model file and scale it to the lengths [m]; None keeps the file's.

        `limits` replaces ranges [rad] by name: any hinge, or `shoulder_twist`. `hand_m` (wrist to fingertip) scales
        the hand's inertia only. Raises ModelError for a file, length or range that cannot be used.
        """
        if side not in SIDES:
            raise ModelError(f"side {side!r} is neither 'left' nor 'right'")
        path = path or resource_folder("models") / "human_arm.xml"
        for name, length in (("upper_arm_m", upper_arm_m), ("forearm_m", forearm_m), ("hand_m", hand_m)):
            if length is not None and not (math.isfinite(length) and 0.0 < length < 2.0):
                raise ModelError(f"{name} = {length}: a length between 0 and 2 metres is needed")
        numbers = _numerics(path)
        try:
            model = pin.buildModelFromMJCF(str(path))
        except Exception as error:  # Pinocchio's readers raise many types
            raise ModelError(f"{path}: Pinocchio cannot read it: {error}") from error
        _require_structure(model, path)
        _scale(model, upper_arm_m, forearm_m, hand_m)
        _limit(model, numbers, limits or {}, path)
        return cls(model, _flatten(model, numbers, side, path), side)

    @cached_property
    def rest(self) -> Array:
        """Arm hanging, elbow slightly bent, thumb forward: (10,), read-only."""
        q = np.zeros(10)
        q[3] = 1.0
        q[4:] = np.radians([15.0, 0.0, 80.0, 0.0, 0.0, 0.0])
        q[4:] = np.clip(q[4:], self.lower, self.upper)
        q.setflags(write=False)
        return q

    @property
    def lower(self) -> Array:
        """Lower limits of HINGES (6,) [rad]."""
        return np.array(self.chains["lower"][0])

    @property
    def upper(self) -> Array:
        """Upper limits of HINGES (6,) [rad]."""
        return np.array(self.chains["upper"][0])

    @property
    def twist_range(self) -> tuple[float, float]:
        """External and internal limit of the shoulder twist [rad], below 140 degrees of elevation."""
        return float(self.chains[0].twist_lower), float(self.chains[0].twist_upper)

    @property
    def swing_range(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Extremes [rad] of shoulder flexion and of shoulder abduction in the swing region."""
        azimuth = np.linspace(-np.pi, np.pi, 721)
        angle = np.clip(self.swing_edge(azimuth), 0.0, np.pi - 1e-6)
        hinges = (np.zeros_like(angle),) * 7
        directions = self.configurations_at(angle, azimuth, *hinges)
        vectors = log(directions[:, :4])
        # the region holds the straight-up arm, which every direction of swing reaches at half a turn
        flexion, abduction = vectors[:, 2], -vectors[:, 0]
        return (float(flexion.min()), math.pi), (float(abduction.min()), math.pi)

    @property
    def speed_limit(self) -> Array:
        """Joint speed limits (9,) [rad/s], tangent order."""
        return np.array(self.chains["speed_limit"][0])

    def forward(self, configurations: npt.ArrayLike) -> dict[str, Array]:
        """Poses in the shoulder frame of configurations (10,) or (N, 10).

        `elbow` is the forearm bone at the elbow and `wrist` the hand bone at the wrist, both in ISB axes; `hand` is the
        wrist in OpenXR wrist axes. Each (7,) or (N, 7): x y z qx qy qz qw.
        """
        q = np.ascontiguousarray(configurations, float)
        rows = np.atleast_2d(q)
        if rows.shape[-1] != 10 or rows.ndim != 2:
            raise ValueError(f"configurations of shape {q.shape}: (10,) or (N, 10) is needed")
        poses = {name: np.empty((len(rows), 7)) for name in ("elbow", "wrist", "hand")}
        forward_poses(self.chains, rows, poses["elbow"], poses["wrist"], poses["hand"])
        return poses if q.ndim == 2 else {name: pose[0] for name, pose in poses.items()}

    def clamp(self, configurations: npt.ArrayLike) -> Array:
        """Bring configurations (..., 10) inside all limits: each shoulder part and each hinge by itself."""
        q = np.array(configurations, float)
        _clamp_rows(self.chains, q.reshape(-1, 10))
        return q

    def excess(self, configurations: npt.ArrayLike) -> Array:
        """How far configurations (..., 10) lie outside each of the first eight LIMITS (..., 8) [rad]; 0 inside."""
        q = np.ascontiguousarray(configurations, float)
        out = np.empty((*q.shape[:-1], 8))
        _excess_rows(self.chains, q.reshape(-1, 10), out.reshape(-1, 8))
        return out

    def swing_edge(self, azimuth: Array) -> Array:
        """Angle [rad] from the swing centre to the edge of the region at azimuths [rad]."""
        chain, k = self.chains[0], np.arange(5)[:, None]
        return np.asarray(chain.swing_cosines @ np.cos(k * azimuth) + chain.swing_sines @ np.sin(k * azimuth))

    def swing_outline(self, azimuth: Array) -> tuple[Array, Array]:
        """Swing centre (3,) and edge (N,3) at azimuths (N,) [rad]: directions in a right arm's shoulder frame."""
        chain, away = self.chains[0], self.swing_edge(azimuth)[:, None]
        aside = np.cos(azimuth)[:, None] * chain.swing_side + np.sin(azimuth)[:, None] * chain.swing_up
        edge = np.cos(away) * chain.swing_centre + np.sin(away) * aside
        return rotate(chain.shoulder_from_isb, chain.swing_centre), rotate(chain.shoulder_from_isb, edge)

    def random_configurations(self, count: int, rng: np.random.Generator, share: float = 1.0) -> Array:
        """Draw configurations (count, 10) uniformly from the middle `share` of every range, swing region included."""
        azimuth = rng.uniform(-np.pi, np.pi, count)
        edge = self.swing_edge(azimuth)
        return self.configurations_at(
            np.sqrt(rng.uniform(0.0, 1.0, count)) * share * edge,
            azimuth,
            *(self.within_range(rng.uniform(-share, share, count), i) for i in range(7)),
        )

    def configurations_at(self, angle: Array, azimuth: Array, twist: Array, *hinges: Array) -> Array:
        """Configurations (N, 10) of a humerus `angle` from the swing centre at `azimuth`, twist and hinges [rad]."""
        chain = self.chains[0]
        u = (
            np.cos(angle)[:, None] * chain.swing_centre
            + (np.sin(angle) * np.cos(azimuth))[:, None] * chain.swing_side
            + (np.sin(angle) * np.sin(azimuth))[:, None] * chain.swing_up
        )
        q = np.empty((len(u), 10))
        half = np.sqrt(np.maximum(0.5 * (1.0 - u[:, 1]), 1e-12))  # cosine of half the angle from hanging
        swing = np.stack([-u[:, 2], np.zeros(len(u)), u[:, 0], 2.0 * half**2], axis=-1) / (2.0 * half[:, None])
        swing /= np.linalg.norm(swing, axis=-1, keepdims=True)
        s, c = np.sin(0.5 * twist), np.cos(0.5 * twist)
        x, z, w = swing[:, 0], swing[:, 2], swing[:, 3]
        q[:, :4] = np.stack([x * c - z * s, w * s, z * c + x * s, w * c], axis=-1)
        q[:, 4:] = np.stack(hinges, axis=-1)
        return q

    def within_range(self, share: Array, index: int) -> Array:
        """Map shares in [-1, 1] onto the range of the twist (index 0) or a hinge (1 to 6)."""
        lower, upper = self.twist_range if index == 0 else (self.lower[index - 1], self.upper[index - 1])
        return np.asarray(0.5 * (lower + upper) + 0.5 * (upper - lower) * share)


def _numerics(path: Path) -> dict[str, list[float]]:
    """Read the <numeric> entries of the file; the other limits are ranges of its joints."""
    try:
        root = ElementTree.parse(path).getroot()
        numbers = {
            str(entry.get("name")): [float(x) for x in str(entry.get("data")).split()]
            for entry in root.iterfind("custom/numeric")
        }
    except OSError as error:
        raise ModelError(f"{path}: {error.strerror}") from error
    except (ElementTree.ParseError, ValueError) as error:
        raise ModelError(f"{path}: {error}") from error
    wanted = {"shoulder_swing_centre": 3, "shoulder_swing_edge": 8, "shoulder_twist_range": 2, "joint_speed_limit": 9}
    for name, count in wanted.items():
        if len(numbers.get(name, ())) != count:
            raise ModelError(f"{path}: <numeric name='{name}'> with {count} numbers is needed")
    return numbers


def _require_structure(model: Any, path: Path) -> None:
    """One ball, then two groups of hinges about Z, X, Y, on straight bones along -y: what the kernel is written for."""
    kinds = [joint.shortname() for joint in model.joints][1:]
    if kinds != ["JointModelSpherical", "JointModelComposite", "JointModelComposite"]:
        raise ModelError(f"{path}: a ball joint and two groups of hinges are needed, found {kinds}")
    for index in (2, 3):
        group = model.joints[index].extract()
        axes = [hinge.shortname() for hinge in group.joints]
        if axes != _HINGE_TYPES or any(not p.isIdentity() for p in group.jointPlacements):
            raise ModelError(f"{path}: {model.names[index]} must be hinges about Z, X, Y in one point, found {axes}")
        placement = model.jointPlacements[index]
        offset = placement.translation
        straight = abs(offset[0]) < _TOLERANCE and abs(offset[2]) < _TOLERANCE and offset[1] < 0.0
        if not straight or not np.allclose(placement.rotation, np.eye(3)):
            raise ModelError(f"{path}: {model.names[index]} must sit on the -y axis of its parent, found {offset}")
    if not model.existFrame("hand", pin.FrameType.OP_FRAME):
        raise ModelError(f"{path}: a site named 'hand' is needed")
    hand = model.frames[model.getFrameId("hand", pin.FrameType.OP_FRAME)]
    if hand.parentJoint != 3 or np.linalg.norm(hand.placement.translation) > _TOLERANCE:
        raise ModelError(f"{path}: the site 'hand' must sit at the wrist joint, on the hand")
    if np.linalg.norm(model.jointPlacements[1].translation) > _TOLERANCE:
        raise ModelError(f"{path}: the shoulder must be the origin of the model")


def _scale(model: Any, upper_arm_m: float | None, forearm_m: float | None, hand_m: float | None) -> None:
    """Stretch the bones; masses and inertias follow as those of a body of equal density and proportions."""
    for index, length in ((1, upper_arm_m), (2, forearm_m)):
        if length is not None:
            factor = length / -model.jointPlacements[index + 1].translation[1]
            model.jointPlacements[index + 1].translation = np.array([0.0, -length, 0.0])
            _scale_inertia(model, index, factor)
    if hand_m is not None:
        _scale_inertia(model, 3, hand_m / _HAND_OF_MODEL_M)


def _scale_inertia(model: Any, index: int, factor: float) -> None:
    inertia = model.inertias[index]
    model.inertias[index] = pin.Inertia(inertia.mass * factor**3, inertia.lever * factor, inertia.inertia * factor**5)


def _limit(model: Any, numbers: dict[str, list[float]], limits: Mapping[str, tuple[float, float]], path: Path) -> None:
    """Write replaced ranges into the model and the numbers, and check all of them."""
    lower, upper = model.lowerPositionLimit.copy(), model.upperPositionLimit.copy()
    for name, (low, high) in limits.items():
        if name in HINGES:
            lower[4 + HINGES.index(name)], upper[4 + HINGES.index(name)] = low, high
        elif name == "shoulder_twist":
            numbers["shoulder_twist_range"] = [math.degrees(low), math.degrees(high)]
        else:
            raise ModelError(f"limit {name!r} is unknown: one of {', '.join((*HINGES, 'shoulder_twist'))}")
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper
    twist = [math.radians(x) for x in numbers["shoulder_twist_range"]]
    ranges = dict(zip(HINGES, zip(lower[4:], upper[4:], strict=True), strict=True))
    for name, (low, high) in {"shoulder_twist": tuple(twist), **ranges}.items():
        if not (math.isfinite(low) and math.isfinite(high)):
            raise ModelError(f"{path}: {name} has no finite range")
        if low > high:
            raise ModelError(
                f"{path}: {name} has its lower limit {math.degrees(low):.1f} "
                f"above its upper {math.degrees(high):.1f} deg"
            )
        if max(-low, high) > math.pi:
            raise ModelError(f"{path}: {name} reaches beyond half a turn; ranges are within -180..180 deg")
    if min(numbers["joint_speed_limit"]) <= 0.0:
        raise ModelError(f"{path}: joint_speed_limit must be positive")
    edge = numbers["shoulder_swing_edge"]
    if min(edge) <= 0.0 or max(edge) >= 180.0:
        raise ModelError(f"{path}: shoulder_swing_edge must lie between 0 and 180 deg")


def _flatten(model: Any, numbers: dict[str, list[float]], side: Side, path: Path) -> npt.NDArray[Any]:
    """Fill the record that compiled code reads."""
    chains = np.zeros(1, CHAIN)
    chain = chains[0]
    chain["left"] = side == "left"
    chain["shoulder_from_isb"] = pin.Quaternion(model.jointPlacements[1].rotation).normalized().coeffs()
    hand = model.frames[model.getFrameId("hand", pin.FrameType.OP_FRAME)].placement.rotation
    chain["bone_from_hand"] = pin.Quaternion(hand).normalized().coeffs()
    chain["upper_arm_m"] = -model.jointPlacements[2].translation[1]
    chain["forearm_m"] = -model.jointPlacements[3].translation[1]
    chain["lower"], chain["upper"] = model.lowerPositionLimit[4:], model.upperPositionLimit[4:]
    bones_m = chain["upper_arm_m"], chain["forearm_m"]
    chain["nearest_m"] = np.sqrt(bones_m[0] ** 2 + bones_m[1] ** 2 + 2.0 * np.prod(bones_m) * np.cos(chain["upper"][0]))
    lower, upper = np.radians(numbers["shoulder_twist_range"])
    chain["twist_lower"], chain["twist_upper"] = lower, upper
    chain["twist_middle"] = np.cos(0.5 * (lower + upper)), np.sin(0.5 * (lower + upper))
    chain["twist_surely_inside"] = np.cos(0.5 * (upper - lower) - 1e-6)
    chain["speed_limit"] = numbers["joint_speed_limit"]
    centre = np.array(numbers["shoulder_swing_centre"])
    if abs(centre[1]) > _TOLERANCE or np.linalg.norm(centre) < _TOLERANCE:
        raise ModelError(f"{path}: shoulder_swing_centre must be a horizontal direction, found {centre}")
    chain["swing_centre"] = centre / np.linalg.norm(centre)
    chain["swing_up"] = (0.0, 1.0, 0.0)
    chain["swing_side"] = np.cross(chain["swing_up"], chain["swing_centre"])
    cosines, sines = edge_series(numbers["shoulder_swing_edge"])
    chain["swing_cosines"], chain["swing_sines"] = cosines, sines
    azimuth = np.linspace(-np.pi, np.pi, 8 * 90 + 1)
    k = np.arange(5)[:, None]
    edge = cosines @ np.cos(k * azimuth) + sines @ np.sin(k * azimuth)
    least = np.full(8, np.pi)
    for cosine, sine, angle in zip(np.cos(azimuth), np.sin(azimuth), edge, strict=True):
        least[octant(cosine, sine)] = min(least[octant(cosine, sine)], angle)
    chain["swing_surely_inside"] = np.cos(least - 0.1)
    return chains


def edge_series(edge_deg: Sequence[float]) -> tuple[Array, Array]:
    """Fourier cosines (5,) and sines (5,) [rad] of the curve through eight equally spaced angles [deg]."""
    series = np.fft.rfft(np.radians(edge_deg)) / 4.0
    series[[0, 4]] /= 2.0
    return series.real.copy(), -series.imag


@compiled
def _clamp_rows(chains: Any, rows: Any) -> None:
    for n in range(len(rows)):
        store_configuration(rows[n], clamped(chains[0], read_configuration(rows[n])))


@compiled
def _excess_rows(chains: Any, rows: Any, out: Any) -> None:
    chain = chains[0]
    for n in range(len(rows)):
        row = rows[n]
        bone = columns_of((row[0], row[1], row[2], row[3]))
        out[n, 0] = max(swing_excess(chain, scale(-1.0, bone[1])), 0.0)
        out[n, 1] = twist_excess(chain, twist_of(bone), -bone[1][1])
        for i in range(6):
            angle = row[4 + i]
            out[n, 2 + i] = min(angle - chain.lower[i], 0.0) + max(angle - chain.upper[i], 0.0)
