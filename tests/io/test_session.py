"""Opening whatever a user names: recognised by what it holds, refused in one line that says why."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from arm_ik_service.errors import SessionError
from arm_ik_service.io.session import BSOR_MAGIC, MCAP_MAGIC, NPZ_MAGIC, answered_frames, open_session
from arm_ik_service.resources import resource_folder

BUNDLED = resource_folder("replay_logs")


def refusal(path: Path) -> SessionError:
    with pytest.raises(SessionError) as caught:
        open_session(path)
    assert "\n" not in str(caught.value)
    assert path.name in str(caught.value)
    return caught.value


def test_a_recording_is_recognised_whatever_its_name(tmp_path: Path) -> None:
    misnamed = tmp_path / "boxing.txt"
    misnamed.write_bytes((BUNDLED / "boxing.mcap").read_bytes())
    assert open_session(misnamed).metadata["format"] == "mcap"


def test_a_missing_file_is_named_with_the_cause(tmp_path: Path) -> None:
    assert "No such file" in str(refusal(tmp_path / "nowhere.mcap"))


def test_a_folder_is_no_session(tmp_path: Path) -> None:
    assert "not a file" in str(refusal(tmp_path))


def test_a_name_that_no_file_can_have_is_refused() -> None:
    with pytest.raises(SessionError):
        open_session(Path("a\x00b.mcap"))


def test_an_empty_file_says_that_it_is_empty(tmp_path: Path) -> None:
    path = tmp_path / "empty.mcap"
    path.touch()
    error = refusal(path)
    assert "empty" in str(error)
    assert error.offset == 0


@pytest.mark.parametrize("magic", [MCAP_MAGIC, BSOR_MAGIC, NPZ_MAGIC])
def test_a_file_that_ends_inside_its_magic_number_says_where(tmp_path: Path, magic: bytes) -> None:
    path = tmp_path / "stub"
    path.write_bytes(magic[:3])
    assert refusal(path).offset == 3


@pytest.mark.parametrize("content", [b"solid teapot\n", b"\x7fELF" + bytes(60), b"{}", b"\x00" * 40])
def test_a_foreign_file_is_refused_with_what_it_begins_with(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "teapot.mcap"
    path.write_bytes(content)
    assert repr(content[:8]) in str(refusal(path))


@given(magic=st.sampled_from([b"", MCAP_MAGIC, BSOR_MAGIC, NPZ_MAGIC]), rest=st.binary(max_size=300))
def test_random_bytes_raise_a_session_error_and_nothing_else(
    tmp_path_factory: pytest.TempPathFactory, magic: bytes, rest: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "random"
    path.write_bytes(magic + rest)
    with pytest.raises(SessionError):
        list(open_session(path).frames())


def test_a_recording_without_answers_has_served_nobody() -> None:
    assert list(answered_frames(open_session(BUNDLED / "boxing.mcap"))) == []
