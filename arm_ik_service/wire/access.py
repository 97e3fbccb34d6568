"""Who may read and write which keys: Zenoh's access control, by the common name of a certificate.

What is not allowed is denied. A headset writes its own controllers and reads its own arms; a viewer reads everything
and writes nothing; a service does as it likes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from arm_ik_service.wire.keys import Keys

_EVERY_MESSAGE = (
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "reply",
    "declare_queryable",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
)


def service_name(name: str) -> str:
    """Common name of a service's, or a router's, certificate."""
    return f"service-{name}"


def headset_name(avatar: str) -> str:
    """Common name of the certificate that may be this avatar."""
    return f"headset-{avatar}"


def viewer_name(name: str) -> str:
    """Common name of the certificate of somebody who only looks: view, record, top."""
    return f"viewer-{name}"


@dataclass
class _Rules:
    """The access_control section while it is built. `ingress` is what they send us, `egress` what we send them."""

    rules: list[dict[str, Any]] = field(default_factory=list)
    subjects: list[dict[str, Any]] = field(default_factory=list)
    policies: list[dict[str, Any]] = field(default_factory=list)

    def allow(self, common_name: str, grants: Sequence[tuple[str, Sequence[str], Sequence[str]]]) -> None:
        """Grant a certificate (direction, messages, keys)."""
        identifiers = [f"{common_name}.{n}" for n in range(len(grants))]
        for identifier, (direction, messages, keys) in zip(identifiers, grants, strict=True):
            self.rules.append(
                {
                    "id": identifier,
                    "permission": "allow",
                    "flows": [direction],
                    "messages": list(messages),
                    "key_exprs": list(keys),
                }
            )
        self.subjects.append({"id": common_name, "cert_common_names": [common_name]})
        self.policies.append({"rules": identifiers, "subjects": [common_name]})


def access_control(common_names: Iterable[str], keys: Keys | None = None) -> dict[str, Any]:
    """Return the `access_control` section for certificates of these common names; other names get nothing."""
    keys = keys or Keys()
    built = _Rules()
    for name in sorted(common_names):
        kind, _, rest = name.partition("-")
        if kind == "service":
            built.allow(name, [(flow, _EVERY_MESSAGE, ["**"]) for flow in ("ingress", "egress")])
        elif kind == "headset":
            described = [keys.skeleton(rest), keys.calibration(rest), keys.arms(rest)]
            built.allow(
                name,
                [
                    ("ingress", ["put"], [keys.controllers(rest)]),
                    ("ingress", ["declare_subscriber", "query"], described),
                    ("egress", ["put", "reply"], described),
                    # so that it learns whether anybody listens
                    ("egress", ["declare_subscriber"], [keys.controllers(rest), keys.controllers()]),
                    ("egress", ["declare_queryable"], [keys.skeleton(), keys.calibration(), keys.arms()]),
                ],
            )
        elif kind == "viewer":
            watched = [keys.watched_controllers(), keys.watched_arms()]
            described = [keys.skeleton(), keys.calibration(), keys.health()]
            everything = [keys.controllers(), keys.arms(), *watched, *described]
            living = [keys.liveliness()]
            built.allow(
                name,
                [
                    ("ingress", ["declare_subscriber", "query"], everything),
                    ("egress", ["put", "reply", "declare_queryable"], everything),
                    ("ingress", ["liveliness_query", "declare_liveliness_subscriber"], living),
                    ("egress", ["liveliness_token"], living),
                ],
            )
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": built.rules,
        "subjects": built.subjects,
        "policies": built.policies,
    }
