"""A code pairs, a token comes back, guessing is bounded."""

from __future__ import annotations

from arm_ik_service.bridges.web.pairing import TRIES_IN_ALL, TRIES_PER_ADDRESS, Pairing, new_code
from arm_ik_service.wire.keys import check_id

SECRET = bytes(range(32))


def test_the_right_code_gives_every_headset_an_id_of_its_own() -> None:
    pairing = Pairing("123456", SECRET)
    ids = {pairing.avatar_for_code(" 123456 ", "here", 0.0) for _ in range(20)}
    assert None not in ids
    assert len(ids) == 20
    assert all(check_id(str(avatar)) for avatar in ids)


def test_a_token_is_good_at_every_bridge_with_the_same_secret_and_at_no_other() -> None:
    token = Pairing("123456", SECRET).token("headset-1")
    assert Pairing("654321", SECRET).avatar_for_token(token) == "headset-1"
    assert Pairing("123456", bytes(32)).avatar_for_token(token) is None


def test_a_token_says_nothing_about_another_avatar() -> None:
    pairing = Pairing("123456", SECRET)
    signature = pairing.token("headset-1").rpartition(".")[2]
    for forged in (f"headset-2.{signature}", "headset-1.", "headset-1", "", f".{signature}", "é.é"):
        assert pairing.avatar_for_token(forged) is None


def test_wrong_codes_lock_their_address_for_a_minute_and_nobody_else() -> None:
    pairing = Pairing("123456", SECRET)
    for _ in range(TRIES_PER_ADDRESS):
        assert not pairing.locked("thief", 10.0)
        assert pairing.avatar_for_code("000000", "thief", 10.0) is None
    assert pairing.locked("thief", 11.0)
    assert not pairing.locked("owner", 11.0)
    assert not pairing.locked("thief", 71.0)


def test_wrong_codes_from_many_addresses_lock_pairing_as_a_whole() -> None:
    pairing = Pairing("123456", SECRET)
    for n in range(TRIES_IN_ALL):
        pairing.avatar_for_code("000000", f"thief-{n}", 0.0)
    assert pairing.locked("owner", 1.0)
    assert pairing.avatar_for_token(pairing.token("headset-1")) == "headset-1"


def test_a_new_code_is_six_digits_and_not_always_the_same() -> None:
    codes = {new_code() for _ in range(20)}
    assert all(len(code) == 6 and code.isdigit() for code in codes)
    assert len(codes) > 10
