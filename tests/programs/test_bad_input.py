"""What a person types wrong ends with one line that names it, and exit code 2; never a traceback."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from harness import COMMAND


@pytest.fixture
def files(tmp_path: Path) -> Path:
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "foreign.mcap").write_bytes(b"GIF89a, not a log" * 100)
    (tmp_path / "not.toml").write_text("[body\nstature_m = ")
    (tmp_path / "giant.toml").write_text("[body]\nstature_m = 17.5\n")
    (tmp_path / "typo.toml").write_text("[body]\nstature = 1.75\n")
    (tmp_path / "limits.toml").write_text("[limits_deg]\nelbow_flexion = [150, 0]\n")
    (tmp_path / "settings.toml").write_text('[service]\nencoding = "xml"\n')
    return tmp_path


CASES = {
    "a missing session": (["solve", "missing.bsor", "-o", "out.npz"], "missing.bsor"),
    "an empty session": (["solve", "empty.mcap", "-o", "out.npz"], "empty.mcap"),
    "a foreign file": (["replay", "foreign.mcap"], "foreign.mcap"),
    "a profile that is no TOML": (["serve", "--profile", "not.toml"], "not.toml"),
    "a profile that is not there": (["serve", "--profile", "nowhere.toml"], "nowhere.toml"),
    "a giant": (["serve", "--profile", "giant.toml"], "stature_m"),
    "a field that is not known": (["serve", "--profile", "typo.toml"], "stature"),
    "a limit with lower above upper": (["serve", "--profile", "limits.toml"], "elbow_flexion"),
    "a setting that is none of the choices": (["serve", "--settings", "settings.toml"], "encoding"),
    "an endpoint that is none": (["serve", "--listen", "nonsense"], "nonsense"),
    "a configuration that is not there": (["serve", "--zenoh-config", "no.json5"], "no.json5"),
    "a demo that does not exist": (["demo", "waltz"], "waltz"),
    "a service with an odd name": (["serve", "--name", "a/b"], "a/b"),
    "an end before the beginning": (["replay", "foreign.mcap", "--from", "3", "--to", "2"], "--to"),
    "an output of no known kind": (["solve", "foreign.mcap", "-o", "out.xyz"], "out.xyz"),
}


@pytest.mark.parametrize(("arguments", "named"), CASES.values(), ids=CASES)
def test_it_ends_with_one_line_that_names_it_and_exit_code_2(arguments: list[str], named: str, files: Path) -> None:
    result = subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, cwd=files, timeout=60)
    assert result.returncode == 2, result.stderr
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1, result.stderr
    assert named in lines[0]
    assert "Traceback" not in result.stderr


@pytest.mark.parametrize("command", ["demo", "serve", "replay", "record", "view", "solve", "convert", "schema"])
def test_the_help_of_every_command_has_an_example(command: str) -> None:
    result = subprocess.run([*COMMAND, command, "--help"], capture_output=True, text=True, timeout=60)
    assert result.returncode == 0
    assert "Example" in result.stdout
    assert f"arm-ik {command}" in result.stdout
