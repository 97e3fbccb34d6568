"""The certificate is made once, names every address, and is made again when it no longer fits."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest

pytest.importorskip("cryptography", reason="needs the extra web")

from arm_ik_service.bridges.web.addresses import own_names, url
from arm_ik_service.bridges.web.certificate import papers
from arm_ik_service.errors import BridgeError

NAMES = ["192.0.2.7", "localhost", "::1"]


def test_papers_are_kept_so_that_an_accepted_certificate_and_a_pairing_survive_a_restart(tmp_path: Path) -> None:
    first, second = papers(tmp_path / "web", NAMES), papers(tmp_path / "web", NAMES[:2])
    assert first.fingerprint == second.fingerprint
    assert first.secret == second.secret
    assert len(first.secret) == 32


def test_a_new_address_gets_a_new_certificate_but_tokens_stay_good(tmp_path: Path) -> None:
    first, second = papers(tmp_path, NAMES), papers(tmp_path, [*NAMES, "198.51.100.3"])
    assert first.fingerprint != second.fingerprint
    assert first.secret == second.secret


def test_a_spoilt_certificate_is_made_again(tmp_path: Path) -> None:
    papers(tmp_path, NAMES)
    (tmp_path / "certificate.pem").write_text("-----BEGIN CERTIFICATE-----\nnonsense\n-----END CERTIFICATE-----\n")
    assert papers(tmp_path, NAMES).fingerprint


def test_key_and_secret_are_for_their_owner_alone(tmp_path: Path) -> None:
    papers(tmp_path / "web", NAMES)
    for file in (tmp_path / "web").iterdir():
        assert stat.S_IMODE(file.stat().st_mode) == 0o600, file


def test_a_folder_that_cannot_be_used_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(BridgeError, match="file"):
        papers(tmp_path / "file", NAMES)


def test_this_machine_always_answers_to_localhost_and_origins_are_written_as_browsers_write_them() -> None:
    assert {"localhost", "127.0.0.1", "::1"} <= set(own_names())
    assert url("192.0.2.7", 8443) == "https://192.0.2.7:8443"
    assert url("::1", 8443) == "https://[::1]:8443"
    assert url("vr.example", 443) == "https://vr.example"
