"""The bridge's own papers: a self-signed certificate and the secret of its tokens, made on the spot and kept.

They are kept so that a headset which accepted the certificate and paired once comes back by itself after a restart.
"""

from __future__ import annotations

import datetime
import ipaddress
import secrets
import ssl
from dataclasses import dataclass
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from arm_ik_service.errors import BridgeError

_VALID = datetime.timedelta(days=397)  # browsers refuse server certificates of more than 398 days
_RENEW = datetime.timedelta(days=14)


@dataclass(frozen=True)
class Papers:
    """What a bridge shows and signs with."""

    tls: ssl.SSLContext
    fingerprint: str  # SHA-256 of the certificate, to compare with what the browser shows
    secret: bytes


def papers(folder: Path, names: list[str]) -> Papers:
    """Load the papers in `folder`, or make them: a certificate is renewed where it lacks a name or soon expires.

    Raises BridgeError where the folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        pem, secret_file = folder / "certificate.pem", folder / "secret"
        if not secret_file.is_file() or len(secret_file.read_bytes()) != 32:
            _write_private(secret_file, secrets.token_bytes(32))
        if not _usable(pem, names):
            _write_private(pem, _make(names))
        tls = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        tls.minimum_version = ssl.TLSVersion.TLSv1_2
        tls.load_cert_chain(pem)
        fingerprint = x509.load_pem_x509_certificate(pem.read_bytes()).fingerprint(hashes.SHA256()).hex(":").upper()
        return Papers(tls, fingerprint, secret_file.read_bytes())
    except OSError as error:
        raise BridgeError(f"certificate in {folder}: {error.strerror or error}; choose another --state") from error


def _usable(pem: Path, names: list[str]) -> bool:
    """Whether the certificate there names all of `names` and will go on to be valid."""
    try:
        certificate = x509.load_pem_x509_certificate(pem.read_bytes())
        alternatives = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except (OSError, ValueError, x509.ExtensionNotFound):
        return False
    named = {str(alternative.value) for alternative in alternatives}
    now = datetime.datetime.now(datetime.UTC)
    return set(names) <= named and now + _RENEW < certificate.not_valid_after_utc


def _make(names: list[str]) -> bytes:
    """Return key and self-signed certificate in one PEM."""
    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "arm-ik bridge")])
    now = datetime.datetime.now(datetime.UTC)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(days=1))  # a headset's clock may be behind
        .not_valid_after(now - datetime.timedelta(days=1) + _VALID)
        .add_extension(x509.SubjectAlternativeName([_alternative(name) for name in names]), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .sign(key, hashes.SHA256())
    )
    private = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    return private + certificate.public_bytes(serialization.Encoding.PEM)


def _alternative(name: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(name))
    except ValueError:
        return x509.DNSName(name)


def _write_private(path: Path, content: bytes) -> None:
    path.unlink(missing_ok=True)
    path.touch(mode=0o600)
    path.write_bytes(content)
