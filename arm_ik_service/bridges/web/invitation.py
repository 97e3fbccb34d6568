"""What the terminal shows to bring a headset to the page: addresses, a QR code, the pairing code."""

from __future__ import annotations

import io

import segno

from arm_ik_service.bridges.web.addresses import url


def invitation(names: list[str], port: int, code: str, fingerprint: str) -> str:
    """Return the text. The QR code carries the pairing code in the fragment, which browsers do not send."""
    here = url(names[0], port)
    drawing = io.StringIO()
    segno.make(f"{here}/#code={code}", error="l").terminal(drawing, compact=True)
    others = ", ".join(url(name, port) for name in names[1:])
    return (
        f"{drawing.getvalue()}\n"
        f"  open   {here}\n"
        f"  code   {code[:3]} {code[3:]}\n\n"
        f"  also   {others}\n"
        "  The certificate is this machine's own: the browser warns once; continue.\n"
        f"  Its SHA-256 begins {fingerprint[:23]}\n"
    )
