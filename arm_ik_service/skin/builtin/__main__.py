"""`python -m arm_ik_service.skin.builtin FILE.glb`: write the built-in arms for other programs to open."""

from __future__ import annotations

import sys
from pathlib import Path

from arm_ik_service.errors import SkinError
from arm_ik_service.skin.builtin import built_in_arms
from arm_ik_service.skin.gltf_writer import write_glb


def main(arguments: list[str]) -> int:
    """Write the file named."""
    if len(arguments) != 1:
        print("usage: python -m arm_ik_service.skin.builtin FILE.glb", file=sys.stderr)
        return 2
    path, mesh = Path(arguments[0]), built_in_arms()
    try:
        write_glb(mesh, path)
    except SkinError as error:
        print(f"arm-ik: {error}", file=sys.stderr)
        return 2
    print(f"{path}: {len(mesh.vertices)} vertices, {len(mesh.triangles)} triangles, {path.stat().st_size / 1e3:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
