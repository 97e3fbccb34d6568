"""The rules that a lab's certificates are given."""

from __future__ import annotations

from arm_ik_service.wire.access import access_control, headset_name, service_name, viewer_name
from arm_ik_service.wire.keys import Keys


def granted(rules: dict[str, object], name: str, direction: str, message: str) -> set[str]:
    keys: set[str] = set()
    for rule in rules["rules"]:  # type: ignore[attr-defined]
        if rule["id"].rpartition(".")[0] == name and rule["flows"] == [direction] and message in rule["messages"]:
            keys.update(rule["key_exprs"])
    return keys


def test_a_headset_may_put_its_own_controllers_alone_and_a_viewer_nothing() -> None:
    rules = access_control([headset_name("7"), headset_name("8"), viewer_name("v"), service_name("s")])
    assert rules["default_permission"] == "deny"
    assert granted(rules, "headset-7", "ingress", "put") == {"avatar/7/controllers"}
    assert granted(rules, "viewer-v", "ingress", "put") == set()
    assert granted(rules, "service-s", "ingress", "put") == {"**"}
    assert "avatar/8/arms" not in granted(rules, "headset-7", "egress", "put")
    for direction, message in (("ingress", "declare_subscriber"), ("egress", "put")):
        assert {"watched/*/arms", "watched/*/controllers"} <= granted(rules, "viewer-v", direction, message)
        assert not any(key.startswith("watched/") for key in granted(rules, "headset-7", direction, message))


def test_every_identity_is_bound_to_its_own_common_name_and_no_rule_to_another() -> None:
    names = [headset_name("7.a"), headset_name("7"), viewer_name("v")]
    rules = access_control(names)
    assert {s["id"]: s["cert_common_names"] for s in rules["subjects"]} == {name: [name] for name in names}
    for policy in rules["policies"]:
        (subject,) = policy["subjects"]
        assert all(rule.rpartition(".")[0] == subject for rule in policy["rules"])


def test_a_prefix_stands_before_every_key_of_the_rules() -> None:
    rules = access_control([headset_name("7"), viewer_name("v")], Keys("lab3"))
    assert all(key.startswith("lab3/") for rule in rules["rules"] for key in rule["key_exprs"])


def test_a_certificate_of_another_kind_is_given_nothing() -> None:
    assert access_control(["printer-2"])["rules"] == []
