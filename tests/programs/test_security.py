"""With certificates and access rules: who is let in, and what each may read and write."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from harness import COMMAND, KEYS, Running, standing, wait_for

from arm_ik_service.errors import BusError
from arm_ik_service.io.zenoh_bus import BusOptions, TlsFiles, open_client
from arm_ik_service.io.zenoh_streams import Bus, declare_stream, living, query, subscribe
from arm_ik_service.programs.demo import free_endpoint
from arm_ik_service.wire import codec

pytestmark = pytest.mark.slow  # real processes, one after the other: the default run has three minutes

FRAMES = 10


def lab(folder: Path, *identities: str) -> Path:
    subprocess.run([*COMMAND, "certificates", str(folder), *identities], check=True, capture_output=True)
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    identities = ("--service", "main", "--headset", "7", "--headset", "8", "--viewer", "screen")
    return lab(tmp_path_factory.mktemp("lab"), *identities)


def papers(folder: Path, name: str) -> TlsFiles:
    return TlsFiles(folder / f"{name}.pem", folder / f"{name}.key", folder / "ca.pem")


class Guarded:
    """A service that listens with TLS only, and tells headsets apart."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.endpoint = free_endpoint().replace("tcp/", "tls/")
        own = papers(folder, "service-main")
        files = ["--tls-cert", str(own.certificate), "--tls-key", str(own.key), "--tls-ca", str(own.authority)]
        access = ["--access", str(folder / "access.json")]
        self.process = Running("serve", "--name", "main", "--listen", self.endpoint, *files, *access)
        self.process.wait_ready()

    def client(self, tls: TlsFiles | None, endpoint: str | None = None) -> Bus:
        return open_client(BusOptions(connect=(endpoint or self.endpoint,), tls=tls), wait_s=0.0)

    def identity(self, name: str) -> Bus:
        return self.client(papers(self.folder, name))


@pytest.fixture(scope="module")
def guarded(folder: Path) -> Iterator[Guarded]:
    service = Guarded(folder)
    yield service
    service.process.popen.kill()
    service.process.popen.wait()


def send(bus: Bus, avatar: str) -> None:
    stream = declare_stream(bus, KEYS.controllers(avatar), "msgpack")
    for seq in range(FRAMES):
        stream.put(codec.encode(standing(seq, seq * 11_111_111)))
        time.sleep(0.01)


def heard(bus: Bus, key: str) -> list[str]:
    keys: list[str] = []
    subscribe(bus, key, lambda got, _payload, _time_ns: keys.append(got))
    return keys


def test_each_headset_writes_and_reads_its_own_and_nothing_else_and_refusals_are_logged(guarded: Guarded) -> None:
    with guarded.identity("headset-7") as seven, guarded.identity("headset-8") as eight:
        own, others, everything = heard(seven, KEYS.arms("7")), heard(eight, KEYS.arms("7")), heard(eight, "**")
        time.sleep(0.2)
        send(seven, "7")
        assert wait_for(lambda: len(own) == FRAMES)
        assert [key for key, _ in query(seven, KEYS.skeleton("7"))] == [KEYS.skeleton("7")]
        assert list(query(eight, KEYS.skeleton("7"))) == []
        assert others == []
        assert everything == []
        with guarded.identity("viewer-screen") as viewer:
            answers, frames = heard(viewer, KEYS.arms()), heard(viewer, KEYS.controllers())
            watched = heard(viewer, KEYS.watched_arms())
            time.sleep(0.2)
            send(eight, "7")  # an impostor
            send(viewer, "7")  # who only looks
            send(eight, "8")
            assert wait_for(lambda: len(answers) == FRAMES)
            time.sleep(0.2)
            assert set(answers) == {KEYS.arms("8")}
            assert set(watched) == {KEYS.watched_arms("8")}
            assert {key for key in frames if key != KEYS.controllers("7")} == {KEYS.controllers("8")}
            assert living(viewer, KEYS.liveliness()) == [KEYS.liveliness("main")]
        assert len(own) == FRAMES
    assert guarded.process.says("denied by access rules: Put on avatar/7/controllers")


def test_no_certificate_and_another_authoritys_are_refused_with_the_likely_cause(
    guarded: Guarded, tmp_path: Path
) -> None:
    elsewhere = lab(tmp_path / "elsewhere", "--headset", "7")
    with pytest.raises(BusError, match="asks for a certificate"):
        guarded.client(None)
    with pytest.raises(BusError, match="signed by the authority"):
        guarded.client(papers(elsewhere, "headset-7"))
    mixed = TlsFiles(elsewhere / "headset-7.pem", elsewhere / "headset-7.key", guarded.folder / "ca.pem")
    with pytest.raises(BusError):
        guarded.client(mixed)
    with pytest.raises(BusError):
        guarded.client(None, guarded.endpoint.replace("tls/", "tcp/"))
    assert guarded.process.says("UnknownCA") or guarded.process.says("DecryptError")


def test_a_certificate_that_names_nobody_in_the_rules_reads_and_writes_nothing(guarded: Guarded, folder: Path) -> None:
    rules = (folder / "access.json").read_text()
    lab(folder, "--headset", "9")  # signed by the same authority after the service had read its rules
    with guarded.identity("headset-9") as nine:
        keys = heard(nine, KEYS.arms("9"))
        time.sleep(0.2)
        send(nine, "9")
        time.sleep(0.2)
        assert keys == []
        assert list(query(nine, KEYS.skeleton("9"))) == []
    assert "headset-9" in (folder / "access.json").read_text()
    assert "headset-9" not in rules


def test_certificates_that_are_there_are_kept_and_keys_are_for_their_owner_alone(folder: Path, tmp_path: Path) -> None:
    once = lab(tmp_path / "lab", "--headset", "1")
    before = {path.name: path.read_bytes() for path in once.iterdir() if path.suffix != ".json"}
    lab(once, "--headset", "1", "--headset", "2")
    assert {name: (once / name).read_bytes() for name in before} == before
    assert (once / "headset-2.key").is_file()
    if os.name == "posix":
        assert {path.stat().st_mode & 0o077 for path in once.glob("*.key")} == {0}


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--tls-cert", "own.pem"], "--tls-key"),
        (["--access", "access.json"], "--tls-cert"),
        (["--tls-cert", "a.pem", "--tls-key", "a.key", "--tls-ca", "ca.pem"], "a.pem"),
    ],
)
def test_half_a_set_of_papers_ends_with_one_line(arguments: list[str], named: str, tmp_path: Path) -> None:
    result = subprocess.run([*COMMAND, "serve", *arguments], capture_output=True, text=True, cwd=tmp_path, timeout=60)
    assert result.returncode == 2
    assert len(result.stderr.splitlines()) == 1
    assert named in result.stderr
