"""`python -m arm_ik_service.io.synthesis FOLDER`: make the bundled recordings again."""

from __future__ import annotations

import sys
from pathlib import Path

import msgspec

from arm_ik_service.io.recording import RecordingWriter
from arm_ik_service.io.synthesis.person import STATURE_M
from arm_ik_service.io.synthesis.scene import Scene
from arm_ik_service.io.synthesis.scenes import SCENES


def write_scene(scene: Scene, folder: Path) -> Path:
    """Write one scene as `<name>.mcap`, with the profile of the person in it. Raises SessionError."""
    path = folder / f"{scene.name}.mcap"
    with RecordingWriter(path, {"about": scene.about, "made_by": "python -m arm_ik_service.io.synthesis"}) as writer:
        for recorded in scene.frames():
            time_ns = recorded.receive_time_ns or 0
            if writer.message_count == 0:
                profile = msgspec.json.encode({"body": {"stature_m": STATURE_M}})
                writer.write_calibration(recorded.avatar, profile, time_ns)
            writer.write_frame(recorded.avatar, recorded.frame, time_ns)
    return path


def main(arguments: list[str]) -> int:
    """Write every scene into the folder named."""
    if len(arguments) != 1 or not (folder := Path(arguments[0])).is_dir():
        print("usage: python -m arm_ik_service.io.synthesis FOLDER", file=sys.stderr)
        return 2
    for scene in SCENES:
        path = write_scene(scene, folder)
        print(f"{path}: {scene.about}; {scene.duration_s:.0f} s, {path.stat().st_size / 1e3:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
