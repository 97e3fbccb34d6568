"""Ids that may stand in a key, and the keys themselves."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from arm_ik_service.errors import WireError
from arm_ik_service.wire.keys import Keys, check_id


@pytest.mark.parametrize("name", ["7", "headset-7", "Anna_B.2"])
def test_plain_ids_are_taken(name: str) -> None:
    assert check_id(name) == name


@pytest.mark.parametrize("name", ["", ".", "..", ".hidden", "a/b", "a*", "**", "a b", "ü", "a\n", "$*", "a?x=1", "a#b"])
def test_ids_that_mean_something_to_a_key_a_path_or_a_shell_are_refused_by_name(name: str) -> None:
    with pytest.raises(WireError) as error:
        check_id(name)
    assert repr(name) in str(error.value)


def test_an_endless_id_is_refused_with_its_length_and_not_repeated_whole() -> None:
    with pytest.raises(WireError, match="5000 characters") as error:
        check_id("x" * 5000)
    assert len(str(error.value)) < 200


@given(st.from_regex(r"\A[A-Za-z0-9_-][A-Za-z0-9_.-]{0,30}\Z"), st.sampled_from(["", "lab3", "a/b"]))
def test_the_avatar_is_found_again_in_every_key_made_for_it(avatar: str, prefix: str) -> None:
    keys = Keys(prefix)
    watched = (keys.watched_controllers, keys.watched_arms)
    for make in (keys.controllers, keys.arms, *watched, keys.skeleton, keys.calibration):
        key = make(avatar)
        assert keys.avatar_of(key) == avatar
        assert key.startswith(prefix)
