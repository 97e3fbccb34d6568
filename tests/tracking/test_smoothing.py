"""Smoothing takes the noise out of rest and leaves motion alone, by the numbers its settings state."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from persons import LEFT, Array, run, standing, stroke

from arm_ik_service.geometry import batch
from arm_ik_service.settings import TrackingSettings

Level = Literal["off", "light", "strong"]


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean((values - values.mean(axis=0)) ** 2)))


@pytest.mark.parametrize("rate", [30.0, 72.0, 90.0, 120.0])
@pytest.mark.parametrize(("level", "at_least"), [("light", 2.5), ("strong", 3.4)])
def test_jitter_at_rest_comes_out_smaller(level: Level, at_least: float, rate: float) -> None:
    rng = np.random.default_rng(7)
    take = standing(20.0, rate)
    noise = rng.normal(0.0, 1e-3, (len(take.t), 3))
    turns = rng.normal(0.0, np.radians(0.3), (len(take.t), 3))
    made = run(
        take.moved(LEFT, noise).turned(LEFT, batch.exp(turns)).frames, tracking=TrackingSettings(smoothing=level)
    )
    settled = slice(round(rate), None)
    assert rms(noise[settled]) / rms(made.position(LEFT)[settled]) >= at_least
    assert rms(turns[settled]) / rms(batch.log(made.device(LEFT)["rotation"][settled])) >= at_least


@pytest.mark.parametrize(("level", "at_most_ms"), [("light", 0.5), ("strong", 5.0)])
def test_a_stroke_is_late_by_no_more_than_is_stated(level: Level, at_most_ms: float) -> None:
    take = standing(1.5, 120.0)
    take = take.moved(LEFT, stroke(take.t, 0.4, 0.5, [0.2, 0.5, -0.4]))
    out = run(take.frames, tracking=TrackingSettings(smoothing=level)).position(LEFT)
    data = take.poses[:, LEFT, :3]
    velocity = np.gradient(data, take.t, axis=0)
    fast = np.linalg.norm(velocity, axis=1) > 2.0
    delay_s = np.sum((data - out)[fast] * velocity[fast]) / np.sum(velocity[fast] ** 2)
    assert fast.sum() > 10
    assert 0.0 < delay_s * 1e3 <= at_most_ms


@pytest.mark.parametrize(("level", "leash_m"), [("light", 0.003), ("strong", 0.02)])
def test_the_output_is_never_farther_from_the_data_than_the_leash(level: Level, leash_m: float) -> None:
    take = standing(4.0)
    t = take.t[:, None]
    wild = 0.3 * np.sin(2.0 * np.pi * (0.2 + 0.7 * t) * t) * np.array([1.0, 0.3, 0.5])
    out = run(take.moved(LEFT, wild).frames, tracking=TrackingSettings(smoothing=level)).position(LEFT)
    away = np.linalg.norm(out - take.poses[:, LEFT, :3] - wild, axis=1)
    assert away.max() <= leash_m * (1.0 + 1e-9)
    assert away.max() > 0.5 * leash_m


def test_off_means_the_very_numbers_that_came_in() -> None:
    take = standing(2.0)
    take = take.moved(LEFT, np.random.default_rng(1).normal(0.0, 2e-3, (180, 3)))
    out = run(take.frames, tracking=TrackingSettings(smoothing="off")).position(LEFT)
    assert np.array_equal(out, take.poses[:, LEFT, :3])


def test_the_same_frames_give_the_same_bytes() -> None:
    rng = np.random.default_rng(5)
    take = standing(3.0).moved(LEFT, np.cumsum(rng.normal(0.0, 0.01, (270, 3)), axis=0)).flagged(LEFT, slice(50, 80), 0)
    first, second = run(take.frames), run(take.frames)
    assert first.tracking.tobytes() == second.tracking.tobytes()
    assert first.body.tobytes() == second.body.tobytes()
