"""The fit of an arm, beside the same worked out from every single sample."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from arm_ik_service.body.arm_fit import (
    ARM_FIT,
    ARM_LENGTH_PART,
    AXIS_M,
    BONES_RANGE,
    ELBOW,
    GIRDLE_GIVES,
    INDEPENDENT_PER_S,
    LOG_SEGMENTS,
    REACH_ERROR_M,
    SHOULDER,
    SHOULDER_M,
    STRETCHED,
    STRETCHED_PART,
    STRETCHES_AFTER_S,
    UNKNOWNS,
    UPPER_ARM,
    begin,
    expect,
    improve,
    linearise,
    show,
    take,
)
from arm_ik_service.compiled import Record
from arm_ik_service.geometry import batch

Array = npt.NDArray[np.float64]

UPPER, FORE, HALF = 0.31, 0.26, 0.18  # [m] expected
SECONDS = 4.0  # little enough that every sample counts


def fresh() -> Record:
    fit = np.zeros(1, ARM_FIT)[0]
    begin(fit, (UPPER, FORE, HALF))
    return fit


def take_in(fit: Record, hands: Array, rotations: Array, seconds: float = SECONDS) -> None:
    for hand, rotation in zip(hands, rotations, strict=True):
        for k in range(2):
            show(fit, k, tuple(hand), tuple(rotation))
        take(fit, seconds / len(hands), seconds / len(hands))


def swung(rng: np.random.Generator, count: int, upper: float, fore: float, shoulder: Array) -> tuple[Array, Array]:
    """Hands and their rotations of an arm with a straight wrist that takes all postures."""
    rotations = batch.normalized(rng.normal(size=(count, 4)))
    away = rng.normal(size=(count, 3))
    elbows = shoulder + upper * away / np.linalg.norm(away, axis=1)[:, None]
    return elbows - batch.rotate(rotations, [0.0, 0.0, fore]), rotations


def residuals(x: Array, fit: Record, hands: Array, rotations: Array) -> Array:
    """Everything that the fit makes small, over its standard deviation."""
    s, e, u = x[SHOULDER:ELBOW], x[ELBOW:UPPER_ARM], x[UPPER_ARM]
    distances = np.linalg.norm(hands + batch.rotate(rotations, e) - s, axis=1)
    weight = np.sqrt(INDEPENDENT_PER_S * fit["seconds"] / len(hands)) / fit["error_m"]
    fore = np.linalg.norm(e)
    length = fore + u
    reach = fit["reach"] - (s - fit["x"][SHOULDER:ELBOW]) @ fit["towards"]
    never = STRETCHED_PART * np.sqrt(1.0 + STRETCHES_AFTER_S / fit["seconds"])
    others = [
        max(reach - GIRDLE_GIVES * length, 0.0) / REACH_ERROR_M,
        max(STRETCHED - reach / length, 0.0) / never,
        (length / (UPPER + FORE) - 1.0) / ARM_LENGTH_PART,
        np.log(u / fore / (UPPER / FORE)) / LOG_SEGMENTS,
        *((s - [HALF, 0.0, 0.0]) / SHOULDER_M),
        *(e[:2] / AXIS_M),
    ]
    return np.concatenate([weight * (distances**2 - u**2) / (2.0 * u), others])


@pytest.mark.parametrize("reach_m", [0.4, 0.65], ids=["never stretched", "too far"])
def test_its_slopes_are_those_of_every_sample_and_expectation(reach_m: float) -> None:
    rng = np.random.default_rng(7)
    fit = fresh()
    hands, rotations = swung(rng, 50, 0.29, 0.24, np.array([0.2, -0.02, 0.03]))
    hands += 0.03 * rng.normal(size=hands.shape)
    take_in(fit, hands, rotations)
    fit["x"] += 0.02 * rng.normal(size=UNKNOWNS)
    fit["reach"], fit["towards"] = reach_m, (0.6, -0.8, 0.0)
    linearise(fit)

    x, h = np.array(fit["x"]), 1e-6
    ways = h * np.eye(UNKNOWNS)
    slopes = np.stack(
        [(residuals(x + w, fit, hands, rotations) - residuals(x - w, fit, hands, rotations)) / (2 * h) for w in ways],
        axis=1,
    )
    np.testing.assert_allclose(fit["normal"], slopes.T @ slopes, rtol=1e-5, atol=1e-3)
    np.testing.assert_allclose(fit["gradient"], slopes.T @ residuals(x, fit, hands, rotations), rtol=1e-5, atol=1e-3)


def test_an_arm_whose_wrist_stays_straight_is_found_exactly_where_nothing_else_is_expected() -> None:
    rng = np.random.default_rng(3)
    fit = fresh()
    fit["length_part"] = 1e3
    take_in(fit, *swung(rng, 400, 1.25 * UPPER, 1.25 * FORE, np.array([HALF, 0.0, 0.0])))
    fit["reach"] = STRETCHED * 1.25 * (UPPER + FORE)
    for _ in range(20):
        improve(fit)
    np.testing.assert_allclose(fit["x"], [HALF, 0.0, 0.0, 0.0, 0.0, 1.25 * FORE, 1.25 * UPPER], atol=1e-6)
    assert fit["residual_m"] < 1e-6


def test_without_samples_it_is_what_is_expected() -> None:
    fit = fresh()
    expect(fit, (1.1 * UPPER, 1.1 * FORE, 1.1 * HALF))
    for _ in range(10):
        improve(fit)
    np.testing.assert_allclose(fit["x"], 1.1 * np.array([HALF, 0.0, 0.0, 0.0, 0.0, FORE, UPPER]), atol=1e-9)


def test_more_samples_of_the_same_change_nothing() -> None:
    rng = np.random.default_rng(5)
    hands, rotations = swung(rng, 60, 0.29, 0.24, np.array([0.2, 0.0, 0.0]))
    once, often = fresh(), fresh()
    take_in(once, hands, rotations, 40.0)
    take_in(often, np.tile(hands, (5, 1)), np.tile(rotations, (5, 1)), 200.0)
    np.testing.assert_allclose(often["moments"], once["moments"], atol=1e-12)


wild = st.floats(-30.0, 30.0, allow_nan=False)


@given(samples=st.lists(st.tuples(wild, wild, wild, st.integers(0, 99), st.floats(0.0, 0.1)), min_size=1, max_size=30))
@settings(max_examples=60, deadline=None)
def test_whatever_is_seen_the_bones_are_those_of_a_person(
    samples: list[tuple[float, float, float, int, float]],
) -> None:
    fit = fresh()
    for x, y, z, seed, seconds in samples:
        rotation = batch.normalized(np.random.default_rng(seed).normal(size=4))
        for k in range(2):
            show(fit, k, (x, y, z), tuple(rotation))
        take(fit, seconds, seconds)
        fit["reach"] = np.linalg.norm([x, y, z])
        improve(fit)
        assert np.isfinite(fit["x"]).all()
        assert BONES_RANGE[0] - 1e-9 <= fit["x"][UPPER_ARM] / UPPER <= BONES_RANGE[1] + 1e-9
        forearm = np.linalg.norm(fit["x"][ELBOW:UPPER_ARM]) / FORE
        assert BONES_RANGE[0] - 1e-9 <= forearm <= BONES_RANGE[1] + 1e-9
        assert BONES_RANGE[0] - 1e-9 <= fit["x"][SHOULDER] / HALF <= BONES_RANGE[1] + 1e-9
