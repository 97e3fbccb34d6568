"""What is cached on disk is never older than the sources it was compiled from."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import arm_ik_service
from arm_ik_service.compiled import compiled, inlined
from arm_ik_service.geometry.scalar import Vector, add, cross

PROGRAM = (
    "from arm_ik_service.arm.model import ArmModel; print(ArmModel.load().forward(ArmModel.load().rest)['wrist'][1])"
)


def test_an_edit_in_a_function_that_another_file_calls_is_seen(tmp_path: Path) -> None:
    package = tmp_path / "arm_ik_service"
    shutil.copytree(Path(arm_ik_service.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    for folder in ("models", "replay_logs"):
        if not (package / folder).is_dir():
            shutil.copytree(Path(arm_ik_service.__file__).parent.parent / folder, tmp_path / folder)

    def wrist_height() -> float:
        environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
        environment.pop("NUMBA_CACHE_DIR", None)
        result = subprocess.run(
            [sys.executable, "-c", PROGRAM], capture_output=True, text=True, env=environment, cwd=tmp_path, check=True
        )
        return float(result.stdout)

    first = wrist_height()
    assert wrist_height() == first
    scalar = package / "geometry" / "scalar.py"
    source = scalar.read_text()
    edited = source.replace(
        "    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])", "    return (a[0] + b[0], a[1] + b[1] + 1.0, a[2] + b[2])"
    )
    assert edited != source
    scalar.write_text(edited)
    assert wrist_height() != first


@inlined
def _twice(a: Vector) -> Vector:
    return add(a, a)


@compiled
def _sixfold(a: Vector) -> Vector:
    return _twice(add(_twice(a), a))


def test_what_is_inlined_into_compiled_functions_runs_as_python_from_python() -> None:
    a = (1.0, -2.0, 3.0)
    assert _sixfold(a) == (6.0, -12.0, 18.0)
    assert _twice(a) == (2.0, -4.0, 6.0)
    assert cross([1, 0, 0], [0, 1, 0]) == (0, 0, 1), "integers, as no compiled entry would leave them"  # type: ignore[arg-type]


def test_processes_that_start_together_fill_one_cache_and_agree(tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}

    def start() -> subprocess.Popen[str]:
        return subprocess.Popen([sys.executable, "-c", PROGRAM], stdout=subprocess.PIPE, text=True, env=environment)

    together = [start() for _ in range(2)]
    heights = {process.communicate()[0] for process in [*together, start()]}
    assert len(heights) == 1
    assert float(heights.pop()) < 0.0
    kept = {path.name.split("-")[0] for path in tmp_path.rglob("*.nbc")}
    assert kept == {"chain.forward_poses"}, "what it is made of is compiled into it, and nothing by itself"


def test_a_process_knows_whether_what_it_called_was_compiled_before(tmp_path: Path) -> None:
    asks = "; from arm_ik_service.arm.chain import forward_poses; from arm_ik_service.compiled import was_cached"
    program = f"{PROGRAM}{asks}; print(was_cached(forward_poses))"
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    says = [
        subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=environment, check=True)
        for _ in range(2)
    ]
    assert [said.stdout.split()[-1] for said in says] == ["False", "True"]
