"""Smoothing takes the noise out of rest and leaves motion alone, by the numbers its settings state."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from persons import LEFT, Array, run, standing, stroke

from arm_ik_service.body.report import jerk_rms
from arm_ik_service.geometry import batch
from arm_ik_service.settings import TrackingSettings

Level = Literal["off", "light", "strong"]


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean((values - values.mean(axis=0)) ** 2)))


def trembling(frames: int) -> Array:
    """Noise (N,3) of 1 mm a component."""
    return np.random.default_rng(3).normal(0.0, 1e-3, (frames, 3))


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
    data = take.poses[:, LEFT, :3]
    take = take.moved(LEFT, trembling(len(take.t)))
    out = run(take.frames, tracking=TrackingSettings(smoothing=level)).position(LEFT)
    velocity = np.gradient(data, take.t, axis=0)
    fast = np.linalg.norm(velocity, axis=1) > 2.0
    delay_s = np.sum((data - out)[fast] * velocity[fast]) / np.sum(velocity[fast] ** 2)
    assert fast.sum() > 10
    assert 0.0 < delay_s * 1e3 <= at_most_ms


@pytest.mark.parametrize(("level", "leash_m"), [("light", 0.003), ("strong", 0.02)])
def test_the_output_is_never_farther_from_the_data_than_the_leash(level: Level, leash_m: float) -> None:
    take = standing(4.0)
    t = take.t[:, None]
    wild = 0.3 * np.sin(2.0 * np.pi * (0.2 + 0.7 * t) * t) * np.array([1.0, 0.3, 0.5]) + trembling(len(t))
    out = run(take.moved(LEFT, wild).frames, tracking=TrackingSettings(smoothing=level)).position(LEFT)
    away = np.linalg.norm(out - take.poses[:, LEFT, :3] - wild, axis=1)
    assert away.max() <= leash_m * (1.0 + 1e-9)
    assert away.max() > 0.5 * leash_m


@pytest.mark.parametrize("rate", [30.0, 90.0, 120.0])
def test_a_smooth_hand_is_left_alone(rate: float) -> None:
    take = standing(4.0, rate)
    angle = 2.0 * np.pi * 0.9 * take.t[:, None]  # a hand that swings as one walks
    swing = 0.25 * np.sin(angle) * np.array([0.1, 0.0, 1.0]) + 0.03 * np.cos(2.0 * angle) * np.array([0.0, 1.0, 0.0])
    take = take.moved(LEFT, swing).turned(LEFT, batch.exp(0.5 * np.sin(angle) * np.array([1.0, 0.2, 0.0])))
    made = run(take.frames, tracking=TrackingSettings(smoothing="light"))
    assert np.abs(made.position(LEFT) - take.poses[:, LEFT, :3]).max() < (3e-3 if rate < 60.0 else 2e-4)
    assert jerk_rms(take.t, made.position(LEFT)) == pytest.approx(jerk_rms(take.t, take.poses[:, LEFT, :3]), rel=0.04)


def test_position_and_rotation_go_the_same_part_of_the_way() -> None:
    rng = np.random.default_rng(9)
    take = standing(3.0)
    take = take.moved(LEFT, np.cumsum(rng.normal(0.0, 2e-3, (270, 3)), axis=0))
    take = take.turned(LEFT, batch.exp(rng.normal(0.0, 0.01, (270, 3))))
    device = run(take.frames).device(LEFT)
    at, data = device["position"], take.poses[:, LEFT, :3]
    gone = np.linalg.norm(at[1:] - at[:-1], axis=1) / np.linalg.norm(data[1:] - at[:-1], axis=1)
    turn, wanted = device["rotation"], take.poses[:, LEFT, 3:]
    turned = batch.angle_between(turn[1:], turn[:-1]) / batch.angle_between(wanted[1:], turn[:-1])
    np.testing.assert_allclose(gone[1:], turned[1:], rtol=1e-3)
    assert np.percentile(gone, 10) < 0.8


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
