"""`arm-ik bench solvers` as a user meets it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from arm_ik_service.bench.peers import PEERS
from arm_ik_service.cli import app
from arm_ik_service.errors import SettingsError

SOLVERS = ["--solver", "jacobian_transpose", "--solver", "damped_least_squares:damping=fixed"]


@pytest.mark.slow
def test_the_table_has_a_row_for_every_solver_and_the_person(capture: Path) -> None:
    outcome = CliRunner().invoke(app, ["bench", "solvers", str(capture), *SOLVERS, "--frames", "20"])
    assert outcome.exit_code == 0, outcome.output
    for text in ("2 arms, 40 frames", "jacobian_transpose ", "damped_least_squares:damping=fixed", "recorded"):
        assert text in outcome.stdout


@pytest.mark.slow
def test_json_is_one_object(capture: Path, headset_session: Path) -> None:
    arguments = ["bench", "solvers", str(capture), str(headset_session), *SOLVERS, "--frames", "20", "--json"]
    outcome = CliRunner().invoke(app, arguments)
    found = json.loads(outcome.stdout)
    assert [arm["session"] for arm in found["arms"]] == ["reaching"] * 2 + ["headset"] * 2
    assert found["solvers"]["jacobian_transpose"]["frames"] == 80


def test_peers_that_are_not_installed_are_listed_with_the_way_to_get_them(capture: Path) -> None:
    absent = {peer.name: why for peer in PEERS if isinstance(why := peer.load(), str)}
    names = [text for peer in PEERS for text in ("--solver", peer.name)]
    arguments = ["bench", "solvers", str(capture), *names, *SOLVERS[:2], "--frames", "2", "--json"]
    assert json.loads(CliRunner().invoke(app, arguments).stdout)["absent"] == absent


@pytest.mark.parametrize(
    ("solver", "what"),
    [
        ("newton", "'newton' is unknown: ours are jacobian_transpose"),
        ("mink:damping=1", "mink is a peer"),
        ("pseudo_inverse:gain=x", "gain=x"),
    ],
)
def test_a_wrong_solver_is_named_before_anything_is_measured(capture: Path, solver: str, what: str) -> None:
    outcome = CliRunner().invoke(app, ["bench", "solvers", str(capture), "--solver", solver])
    assert isinstance(outcome.exception, SettingsError)
    assert what in str(outcome.exception)
