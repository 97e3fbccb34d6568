"""Profiles go to disk and come back the same, by path or by name."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from arm_ik_service.body.profile import (
    POINTING_GRIPS,
    BodyMeasures,
    Profile,
    RangesOfMotion,
)
from arm_ik_service.errors import ProfileError
from arm_ik_service.io.profile_store import (
    find_profile,
    load_profile,
    profile_names,
    profile_path,
    profile_toml,
    save_profile,
)

lengths = st.one_of(st.none(), st.integers(50, 1999).map(lambda mm: mm / 1000.0))


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ARM_IK_PROFILES", str(tmp_path / "profiles"))
    return tmp_path / "profiles"


@given(st.integers(500, 2600), lengths, lengths, lengths)
def test_what_is_written_is_read_back(
    tmp_path_factory: pytest.TempPathFactory, stature: int, upper: float | None, fore: float | None, width: float | None
) -> None:
    path = tmp_path_factory.mktemp("profile") / "me.toml"
    body = BodyMeasures(stature_m=stature / 1000.0, upper_arm_m=upper, forearm_m=fore, shoulder_width_m=width)
    profile = Profile(body=body, limits_deg=RangesOfMotion(elbow_flexion=(0.0, 120.0)))
    save_profile(profile, path, notes=["made by a test"])
    assert load_profile(path) == profile


def test_grips_come_back_to_the_last_digit_that_matters(tmp_path: Path) -> None:
    save_profile(Profile(grip=POINTING_GRIPS), tmp_path / "sword.toml")
    read = load_profile(tmp_path / "sword.toml").grip
    assert read.left.orientation_xyzw == pytest.approx(POINTING_GRIPS.left.orientation_xyzw, abs=1e-6)
    assert read.right.position_m == POINTING_GRIPS.right.position_m


def test_the_file_explains_itself() -> None:
    text = profile_toml(Profile(), notes=["from a T-pose", "arms to 1.5 cm"])
    assert text.startswith("# from a T-pose\n# arms to 1.5 cm\n[body]\nstature_m = 1.75  # what is missing")


def test_a_name_is_a_file_in_the_users_folder(folder: Path) -> None:
    save_profile(Profile(body=BodyMeasures(stature_m=1.6)), profile_path("ada"))
    assert (folder / "ada.toml").is_file()
    assert profile_names() == ["ada"]
    assert find_profile("ada").body.stature_m == 1.6
    assert find_profile(str(folder / "ada.toml")).body.stature_m == 1.6
    assert find_profile(None) == Profile()


def test_an_unknown_name_is_refused_with_the_names_there_are() -> None:
    save_profile(Profile(), profile_path("ada"))
    with pytest.raises(ProfileError, match=r"'bob'.*there are: ada"):
        find_profile("bob")


@pytest.mark.parametrize("name", ["", "no spaces", "ä", "x" * 65, "a:b"])
def test_a_name_that_is_no_file_name_is_refused(name: str) -> None:
    with pytest.raises(ProfileError, match="a name has letters"):
        profile_path(name)


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ProfileError, match="file"):
        save_profile(Profile(), tmp_path / "file" / "me.toml")
