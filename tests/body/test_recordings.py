"""Against real motion capture: how far the shoulders are from where they were recorded."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

import numpy as np
from persons import Array, Take, run

from arm_ik_service.body.profile import BodyMeasures, Profile
from arm_ik_service.geometry import batch


def _length(truth: dict[str, Array], a: str, b: str) -> float:
    return float(np.median(np.linalg.norm(truth[a] - truth[b], axis=1)))


def test_shoulders_are_found_on_people_of_every_family(recordings: Path) -> None:
    errors_m, yaw_steps = defaultdict(list), []
    for path in sorted((recordings / "mocap").glob("*.npz")):
        with np.load(path) as archive:
            truth = {name: archive[name] for name in archive.files}
        poses = np.stack([truth["head"], truth["left"], truth["right"]], axis=1).astype(float)
        take = Take(truth["t"], poses, np.full(poses.shape[:2], 15))
        measures = BodyMeasures(
            upper_arm_m=_length(truth, "left_shoulder", "left_elbow"),
            forearm_m=_length(truth, "left_elbow", "left_wrist"),
            shoulder_width_m=_length(truth, "left_shoulder", "right_shoulder"),
        )
        body = run(take.frames, profile=Profile(body=measures)).body
        for k, side in enumerate(("left", "right")):
            away = np.linalg.norm(body["shoulders"][:, k] - truth[f"{side}_shoulder"], axis=1)
            errors_m[path.name.split("_")[0]].append(away.mean())
        z = batch.rotate(body["chest_rotation"], [0.0, 0.0, 1.0])
        yaw_steps.append(np.abs(np.diff(np.unwrap(np.arctan2(z[:, 0], z[:, 2])))).max())
    assert len(errors_m) == 5
    assert np.mean([np.mean(family) for family in errors_m.values()]) <= 0.046
    assert np.degrees(max(yaw_steps)) <= 20.0
