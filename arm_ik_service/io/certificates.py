"""A certificate authority for a lab, and the certificates it signs: who a service, a headset, a viewer is.

One folder holds all of it: `ca.pem` and `ca.key`, and for each identity `NAME.pem` and `NAME.key`. What is there is
kept, so that the command may be run again to add a headset. Another machine gets `ca.pem` and its own pair.
"""

from __future__ import annotations

import datetime
import ipaddress
from collections.abc import Sequence
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from arm_ik_service.errors import SettingsError

AUTHORITY = "ca"
_BEGINS_BEFORE = datetime.timedelta(days=1)  # the clock of another machine may be behind


class Authority:
    """The authority in a folder; made where there is none."""

    def __init__(self, folder: Path, days: int) -> None:
        """Raises SettingsError where the folder cannot be written or holds something else."""
        self._folder = folder
        self._days = days
        self.made: list[Path] = []
        certificate, key = folder / f"{AUTHORITY}.pem", folder / f"{AUTHORITY}.key"
        try:
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            if not certificate.is_file() or not key.is_file():
                self._key = ec.generate_private_key(ec.SECP256R1())
                self._certificate = self._authority()
                self._write(AUTHORITY, self._key, self._certificate)
                return
            self._certificate = x509.load_pem_x509_certificate(certificate.read_bytes())
            loaded = serialization.load_pem_private_key(key.read_bytes(), None)
        except OSError as error:
            raise SettingsError(f"{folder}: {error.strerror or error}") from error
        except (ValueError, TypeError) as error:
            raise SettingsError(f"{certificate} or {key} is not what this command writes: {error}") from error
        if not isinstance(loaded, ec.EllipticCurvePrivateKey):
            raise SettingsError(f"{key} is not what this command writes: it holds another kind of key")
        self._key = loaded

    def issue(self, common_name: str, hosts: Sequence[str]) -> None:
        """Make the identity's certificate and key unless they are there; `hosts` are the names it listens under."""
        if (self._folder / f"{common_name}.pem").is_file():
            return
        key = ec.generate_private_key(ec.SECP256R1())
        # headsets and viewers listen nowhere, but TLS wants a name
        names = [_name(host) for host in hosts] or [x509.DNSName(common_name)]
        certificate = (
            self._builder(common_name, key)
            .add_extension(x509.SubjectAlternativeName(names), critical=False)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(
                x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]),
                critical=False,
            )
            .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(self._key.public_key()), critical=False)
            .sign(self._key, hashes.SHA256())
        )
        self._write(common_name, key, certificate)

    def identities(self) -> list[str]:
        """Common names of all certificates in the folder that are ours."""
        found = []
        for path in sorted(self._folder.glob("*.pem")):
            if path.stem == AUTHORITY:
                continue
            certificate = x509.load_pem_x509_certificate(path.read_bytes())
            if certificate.issuer == self._certificate.subject:
                found.append(common_name_of(certificate))
        return found

    def _authority(self) -> x509.Certificate:
        return (
            self._builder("arm-ik lab authority", self._key)
            .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
            .add_extension(x509.SubjectKeyIdentifier.from_public_key(self._key.public_key()), critical=False)
            .sign(self._key, hashes.SHA256())
        )

    def _builder(self, common_name: str, key: ec.EllipticCurvePrivateKey) -> x509.CertificateBuilder:
        subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])
        begins = datetime.datetime.now(datetime.UTC) - _BEGINS_BEFORE
        issuer = getattr(self, "_certificate", None)
        return (
            x509.CertificateBuilder()
            .subject_name(subject)
            .issuer_name(issuer.subject if issuer is not None else subject)
            .public_key(key.public_key())
            .serial_number(x509.random_serial_number())
            .not_valid_before(begins)
            .not_valid_after(begins + _BEGINS_BEFORE + datetime.timedelta(days=self._days))
        )

    def _write(self, name: str, key: ec.EllipticCurvePrivateKey, certificate: x509.Certificate) -> None:
        private = key.private_bytes(
            serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        )
        key_path, path = self._folder / f"{name}.key", self._folder / f"{name}.pem"
        key_path.unlink(missing_ok=True)
        key_path.touch(mode=0o600)
        key_path.write_bytes(private)
        path.write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
        self.made += [path, key_path]


def common_name_of(certificate: x509.Certificate) -> str:
    """Return whom a certificate names."""
    return str(certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)[0].value)


def days_left(path: Path) -> float:
    """Return for how many days a PEM certificate is still valid. Raises SettingsError where it cannot be read."""
    try:
        certificate = x509.load_pem_x509_certificate(path.read_bytes())
    except (OSError, ValueError) as error:
        raise SettingsError(f"{path} is no certificate: {error}") from error
    left = certificate.not_valid_after_utc - datetime.datetime.now(datetime.UTC)
    return left.total_seconds() / 86_400.0


def _name(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        return x509.DNSName(host)
