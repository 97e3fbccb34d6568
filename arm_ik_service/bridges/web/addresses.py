"""Under which names and addresses this machine can be reached, as far as it knows itself."""

from __future__ import annotations

import contextlib
import socket

_ELSEWHERE = (("192.0.2.1", socket.AF_INET), ("2001:db8::1", socket.AF_INET6))  # documentation only (RFC 5737, 3849)


def own_addresses() -> list[str]:
    """Return the addresses by which others on the network reach this machine, the likeliest first; may be empty.

    Connecting a datagram socket sends nothing: it asks the routing table which of our addresses would be used.
    """
    found: list[str] = []
    for target, family in _ELSEWHERE:
        try:
            with socket.socket(family, socket.SOCK_DGRAM) as probe:
                probe.connect((target, 9))
                found.append(probe.getsockname()[0])
        except OSError:
            continue
    with contextlib.suppress(OSError):
        found += [str(entry[4][0]) for entry in socket.getaddrinfo(socket.gethostname(), None)]
    usable = [a for a in found if not a.startswith(("127.", "fe80:", "0.")) and a != "::1"]
    return list(dict.fromkeys(usable))


def own_names() -> list[str]:
    """Return every name and address to put into a certificate and to accept as an origin."""
    host = socket.gethostname().lower()
    local = host if host.endswith(".local") else f"{host}.local"
    return list(dict.fromkeys([*own_addresses(), host, local, "localhost", "127.0.0.1", "::1"]))


def url(name: str, port: int) -> str:
    """Return the origin of a page served under that name: https://NAME:PORT, brackets about IPv6, no default port."""
    bracketed = f"[{name}]" if ":" in name else name
    return f"https://{bracketed}" if port == 443 else f"https://{bracketed}:{port}"
