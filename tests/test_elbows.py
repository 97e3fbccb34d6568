"""The elbows of the whole chain, controllers in to arms out, beside those that were recorded."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

import numpy as np
from persons import measures_of

from arm_ik_service.avatar import Avatar
from arm_ik_service.body.profile import Profile
from arm_ik_service.body.report import jerk_rms
from arm_ik_service.io.session import open_session

JERK_AT_MOST = 1.25  # of either side; wanted is 1.2, met on the machine it was measured on


def test_elbows_are_near_the_recorded_ones_and_hardly_less_calm(recordings: Path) -> None:
    errors_m, jerks = defaultdict(list), []
    for path in sorted((recordings / "mocap").glob("*.npz")):
        with np.load(path) as archive:
            truth = {name: archive[name] for name in archive.files}

        avatar = Avatar(Profile(body=measures_of(truth)))
        frames = [recorded.frame for recorded in open_session(path).frames()]
        states = [avatar.step(frame, frame.sample_time_ns) for frame in frames]
        for side in ("left", "right"):
            arms = [getattr(state, side) for state in states if state is not None]
            assert len(arms) == len(frames)
            elbows = np.array([arm.bones.forearm.position for arm in arms])
            recorded = truth[f"{side}_elbow"]
            errors_m[path.name.split("_")[0]].append(np.linalg.norm(elbows - recorded, axis=1).mean())
            jerk = jerk_rms(truth["t"], elbows) / jerk_rms(truth["t"], recorded)
            jerks.append(jerk)
            assert jerk <= JERK_AT_MOST, (path.name, side)
    assert len(errors_m) == 5
    assert np.median(jerks) < 1.1
    assert np.mean([np.mean(family) for family in errors_m.values()]) <= 0.056
