"""Fit the constants of `arm_ik_service.ik.comfort` to recorded elbows.

    python tests/bench/fit_elbow_comfort.py DATA [--generations 16] [--ridge 1.0]

DATA is a folder of recordings with true shoulders, elbows and wrists (`.npz`: t, {left,right}_{shoulder,elbow,wrist}
(N,3), {left,right}_wrist_q (N,4) in the OpenXR wrist frame). Those whose names begin with `cmu` or `xia` are fitted to;
every family found is reported. What is minimised is the mean distance of the elbow that `track` gives from the recorded
one, each person weighing the same, and

- every arm is also tracked with its hand turned by a random, constant rotation: how a hand sits on its tracker differs
  from person to person, and nothing fitted may lean on one person's way;
- a ridge draws every constant (weights by their logarithm) to FIRST, the mean of earlier fits with a weak ridge;
- the answer is the mean over independent draws of those rotations.

Takes some minutes. The constants it prints go into COMFORT by hand.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from arm_ik_service.arm.model import ArmModel
from arm_ik_service.geometry import batch
from arm_ik_service.ik.comfort import COMFORT
from arm_ik_service.ik.jacobian_transpose import JacobianTranspose
from arm_ik_service.wire.messages import SIDES

Array = npt.NDArray[np.float64]

FIRST = {
    "pronation_rest": 1.35,
    "pronation_weight": 0.05,
    "flexion_weight": 1.2,
    "deviation_weight": 1.75,
    "twist_weight": 0.24,
    "twist_rest": 0.0,
    "twist_forward": 0.3,
    "twist_up": 0.35,
    "twist_out": -0.8,
    "pull_down": 0.4,
    "pull_out": 0.9,
}
IS_WEIGHT = np.array([name.endswith("weight") for name in FIRST])
MOUNTS_RAD = (0.1, 0.2)  # how far hands are turned, by draw
FITTED_TO = ("cmu", "xia")


@dataclass
class Arm:
    """One recorded arm: targets (N, 7) and true elbows (N, 3) in the shoulder frame."""

    family: str
    person: str
    solver: JacobianTranspose
    targets: Array
    elbows: Array

    def error_m(self, comfort: Array, targets: Array | None = None) -> float:
        """Mean distance of the tracked elbow from the recorded one [m]."""
        self.solver.set_comfort(comfort)
        track = self.solver.track(self.targets if targets is None else targets)
        found = self.solver.arm.forward(track.configuration)["elbow"][:, :3]
        return float(np.linalg.norm(found - self.elbows, axis=1).mean())


def load(path: Path, most_hz: float) -> list[Arm]:
    """Read both arms of a recording, at a rate of at most `most_hz`, on a body axis through both shoulders."""
    data = np.load(path)
    rate = 1.0 / float(np.median(np.diff(data["t"])))
    stride = max(1, int(rate / most_hz))
    right = data["right_shoulder"][::stride].astype(float) - data["left_shoulder"][::stride]
    right[:, 1] = 0.0
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    up = np.broadcast_to([0.0, 1.0, 0.0], right.shape)
    chest = batch.conjugate(batch.from_matrix(np.stack([right, up, np.cross(right, up)], axis=-1)))
    words = path.stem.split("_")
    person = {"cmu": "_".join(words[:3]) if words[1] == "salsa" else "_".join(words[:2]), "xia": "xia"}
    arms = []
    for side in SIDES:
        shoulder, elbow, wrist = (
            data[f"{side}_{name}"][::stride].astype(float) for name in ("shoulder", "elbow", "wrist")
        )
        elbow, wrist = batch.rotate(chest, elbow - shoulder), batch.rotate(chest, wrist - shoulder)
        rotation = batch.multiply(chest, batch.normalized(data[f"{side}_wrist_q"][::stride].astype(float)))
        model = ArmModel.load(
            side, float(np.linalg.norm(elbow, axis=1).mean()), float(np.linalg.norm(wrist - elbow, axis=1).mean())
        )
        solver = JacobianTranspose(model, frame_rate_hz=rate / stride)
        targets = np.concatenate([wrist, rotation], axis=1)
        arms.append(Arm(words[0], person.get(words[0], words[0]), solver, targets, elbow))
    return arms


def per_group(arms: list[Arm], errors: list[float], group: Callable[[Arm], str]) -> dict[str, float]:
    """Mean error by group."""
    found: dict[str, list[float]] = {}
    for arm, error in zip(arms, errors, strict=True):
        found.setdefault(group(arm), []).append(error)
    return {name: float(np.mean(values)) for name, values in found.items()}


def constants(z: Array) -> Array:
    """Constants at an offset z from FIRST: weights by factors exp(z), the others by addition."""
    first = np.array(list(FIRST.values()))
    return np.where(IS_WEIGHT, first * np.exp(z), first + z)


def minimise(loss: Callable[[Array], float], size: int, generations: int, rng: np.random.Generator) -> Array:
    """Evolution strategy with covariance adaptation by rank-mu update (after Hansen 2016, simplified)."""
    offspring, parents, mean, sigma = 14, 7, np.zeros(size), 0.2
    covariance, rate = np.eye(size), 0.25
    weights = np.log(parents + 0.5) - np.log(np.arange(1, parents + 1))
    weights /= weights.sum()
    for _ in range(generations):
        steps = rng.multivariate_normal(np.zeros(size), covariance, offspring)
        order = np.argsort([loss(mean + sigma * step) for step in steps])[:parents]
        best = steps[order]
        mean = mean + sigma * weights @ best
        covariance = (1.0 - rate) * covariance + rate * (best.T * weights) @ best
        sigma *= 0.95
    return mean


def main() -> None:
    """Run the fit and report it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("--generations", type=int, default=16)
    parser.add_argument("--ridge", type=float, default=1.0, help="[cm] added for a constant one unit away from FIRST")
    arguments = parser.parse_args()
    paths = sorted(arguments.data.glob("*.npz"))
    fitted = [arm for path in paths if path.stem.startswith(FITTED_TO) for arm in load(path, 30.0)]

    answers = []
    for draw, mount in enumerate(MOUNTS_RAD * 2):
        rng = np.random.default_rng(draw)
        turned = []
        for arm in fitted:
            targets = arm.targets.copy()
            targets[:, 3:] = batch.multiply(targets[:, 3:], batch.exp(rng.normal(0.0, mount, 3)))
            turned.append(targets)

        def loss(z: Array, turned: list[Array] = turned) -> float:
            comfort = constants(z)
            errors = [0.5 * (a.error_m(comfort) + a.error_m(comfort, t)) for a, t in zip(fitted, turned, strict=True)]
            by_person = per_group(fitted, errors, lambda one: one.person)
            return 100.0 * float(np.mean(list(by_person.values()))) + float(arguments.ridge) * float(z @ z)

        answers.append(minimise(loss, len(FIRST), arguments.generations, rng))
        print(f"draw {draw}: {loss(answers[-1]):.3f} cm")
    comfort = constants(np.mean(answers, axis=0))

    everyone = [arm for path in paths for arm in load(path, 120.0)]
    for title, values in (("now", np.array(list(COMFORT.values()))), ("fitted", comfort)):
        errors = [100.0 * arm.error_m(values) for arm in everyone]
        families = per_group(everyone, errors, lambda arm: arm.family)
        shown = ", ".join(f"{name} {error:.2f}" for name, error in families.items())
        print(f"{title}: macro mean {np.mean(list(families.values())):.3f} cm ({shown})")
    for name, value in zip(FIRST, comfort, strict=True):
        print(f'    "{name}": {value:.2f},')


if __name__ == "__main__":
    main()
