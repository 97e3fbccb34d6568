"""The house of README's "Where things are": data runs left to right, imports point the other way."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "arm_ik_service"

FOUNDATION = {"errors", "compiled", "resources"}
ROOMS: dict[str, set[str]] = {
    "errors": set(),
    "compiled": set(),
    "resources": set(),
    "geometry": {"compiled", "errors"},
    "wire": {"errors"},
    "settings": {"errors", "compiled", "wire"},
    "tracking": {*FOUNDATION, "geometry", "settings", "wire"},
    "body": {*FOUNDATION, "geometry", "settings", "wire", "tracking"},
    "arm": {*FOUNDATION, "geometry", "wire"},
    "ik": {*FOUNDATION, "geometry", "settings", "arm", "wire"},
    "output": {*FOUNDATION, "geometry", "wire", "arm", "ik"},
    "skeleton": {*FOUNDATION, "wire", "arm", "body"},
    "pipeline": {*FOUNDATION, "settings", "wire", "tracking", "body", "arm", "ik"},
    "avatar": {*FOUNDATION, "geometry", "settings", "wire", "tracking", "body", "arm", "output", "pipeline"},
    "calibration": {*FOUNDATION, "geometry", "settings", "tracking", "body", "pipeline"},
    "skin": {*FOUNDATION, "geometry", "wire"},
    "io": {*FOUNDATION, "geometry", "settings", "wire", "skin", "body"},
    "exports": {*FOUNDATION, "geometry", "wire", "body"},
    "bridges": {*FOUNDATION, "geometry", "wire", "body", "io"},
}
EVERYTHING = {"programs", "bench", "cli", "__init__", "__main__"}  # these put the rest together

# a library that only one kind of module may import
OWNERS: dict[str, str | tuple[str, ...]] = {
    "zenoh": "io.zenoh_",
    "filelock": "compiled",
    "rerun": "io.rerun_view",
    "mcap": ("io.recording", "exports.mcap_files"),
    "pinocchio": ("arm.", "ik.", "bench.peers"),
    "rosbags": "exports.ros2",
    "foxglove": ("exports.foxglove_messages", "exports.mcap_files"),
    "pyarrow": "exports.table",
    "pygltflib": "skin.gltf",
    "PIL": "skin.gltf",
    "typer": "cli",
    "rich": "cli",
    "numba": ("compiled", "ik.clock"),  # the clock of a solver's time limit is an LLVM intrinsic
    "xr": "bridges.openxr.pyopenxr",
    "aiohttp": "bridges.web.server",
    "cryptography": ("bridges.web.certificate", "io.certificates"),
    "segno": "bridges.web.invitation",
}


MODULES = [(".".join(path.relative_to(PACKAGE).with_suffix("").parts), path) for path in sorted(PACKAGE.rglob("*.py"))]


def imports(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute"
            for alias in node.names:
                yield f"{node.module}.{alias.name}"


@pytest.mark.parametrize(("module", "path"), MODULES, ids=[module for module, _ in MODULES])
def test_a_room_imports_only_the_rooms_before_it(module: str, path: Path) -> None:
    room = module.split(".")[0]
    if room in EVERYTHING:
        return
    allowed = ROOMS[room] | {room}
    for name in imports(path):
        if name.startswith("arm_ik_service."):
            other = name.split(".")[1]
            if other == "__version__":
                continue
            assert other in allowed, f"{module} may not import {name}"


@pytest.mark.parametrize(("module", "path"), MODULES, ids=[module for module, _ in MODULES])
def test_a_library_is_imported_only_by_the_module_it_belongs_to(module: str, path: Path) -> None:
    for name in imports(path):
        owner = OWNERS.get(name.split(".")[0])
        if owner is not None:
            assert module.startswith(owner), f"{module} may not import {name}: that belongs to {owner}"


def test_the_pure_stages_know_no_clock_no_file_and_no_thread() -> None:
    forbidden = {"time", "threading", "logging", "asyncio", "socket", "subprocess", "random"}
    forbidden |= {"pathlib", "os", "platformdirs"}
    for module, path in MODULES:
        if module.split(".")[0] in {"geometry", "tracking", "body", "arm", "ik", "wire", "output", "avatar"}:
            used = {name.split(".")[0] for name in imports(path)} & forbidden
            if module == "ik.clock":  # a time limit needs one; it is off by default, so replays do not see it
                used -= {"time"}
            if module == "arm.model":  # it reads the description of the arm, once
                used -= {"pathlib"}
            assert not used, f"{module} imports {used}"
