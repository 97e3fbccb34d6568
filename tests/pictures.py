"""Make the pictures of the README again.

    python tests/pictures.py FOLDER [--avatar FILE.glb] [--only view --only grab ...]

All of them are of the bundled recordings, of made-up postures and of the scripted person. `--avatar` is the humanoid
of `avatar.png`, which is left out without one. Needs a Vulkan driver, as `write_picture` does; software will do.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterable
from itertools import islice
from pathlib import Path

import msgspec
from harness import COMMAND
from PIL import Image, ImageDraw, ImageFont
from postures import Arm, person

from arm_ik_service.bench.processes import part
from arm_ik_service.io.rerun_view import OVERLAYS, RerunView, Save, Skin, write_picture
from arm_ik_service.io.session import RecordedFrame, open_session
from arm_ik_service.io.zenoh_bus import BusOptions, open_client
from arm_ik_service.io.zenoh_streams import declare_stream
from arm_ik_service.programs.demo import bundled_session, free_endpoint
from arm_ik_service.programs.elbow_comfort import ElbowComforts
from arm_ik_service.programs.offline import profiles_for, solve_frames
from arm_ik_service.settings import Settings
from arm_ik_service.skeleton import skeleton_of
from arm_ik_service.skin.load import load_built_in_arms
from arm_ik_service.wire import codec
from arm_ik_service.wire.keys import Keys
from arm_ik_service.wire.messages import ArmsState, Skeleton

TOP_BAR = 36  # [px] that the viewer leaves empty where its menu was
TITLE_BAR = 28  # of a view
RATE_HZ = 90.0
RECORDINGS = ("boxing", "reach_and_grab", "tracking_loss")
CROWD_FRAMES = 456
LARGEST_BYTES = 200 * 1024
Box = tuple[float, float, float, float]  # left, top, right, bottom, in parts of a picture


def shot(recording: Path, frame: int | None = None, width: int = 1600, height: int = 900) -> Image.Image:
    """The viewer's window at a frame, without its menu."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "shot.png"
        write_picture(recording, path, frame=frame, width=width, height=height)
        image = Image.open(path).convert("RGB")
    return image.crop((0, TOP_BAR, image.width, image.height))


def people_of(window: Image.Image, share: float = 1.25 / 2.25) -> Image.Image:
    """The view of the people alone: without plots, title and legend."""
    return window.crop((2, TITLE_BAR, round(share * window.width) - 2, round(0.915 * window.height)))


def part_of(image: Image.Image, box: Box, width: int) -> Image.Image:
    """A part, made so wide."""
    left, top, right, bottom = (side * full for side, full in zip(box, 2 * image.size, strict=True))
    part = image.crop((round(left), round(top), round(right), round(bottom)))
    return part.resize((width, round(width * part.height / part.width)), Image.Resampling.LANCZOS)


def beside(images: list[Image.Image], captions: Iterable[str], gap: int = 4) -> Image.Image:
    """Pictures in a row, each with its caption in its upper left corner."""
    row = Image.new("RGB", (sum(i.width for i in images) + gap * (len(images) - 1), images[0].height), (90, 96, 106))
    font, left = ImageFont.load_default(size=20), 0
    for image, caption in zip(images, captions, strict=True):
        row.paste(image, (left, 0))
        place, dark = (left + 12, 8), (24, 27, 33)
        ImageDraw.Draw(row).text(place, caption, (235, 238, 242), font, stroke_width=2, stroke_fill=dark)
        left += image.width + gap
    return row


def save(image: Image.Image, path: Path) -> None:
    """Write as small as a palette makes it."""
    for colours in (256, 192, 128, 96, 64):
        image.quantize(colours, Image.Quantize.MEDIANCUT, kmeans=3, dither=Image.Dither.NONE).save(path, optimize=True)
        if path.stat().st_size < LARGEST_BYTES:
            break
    print(f"{path}: {image.width} x {image.height}, {path.stat().st_size / 1024:.0f} KiB")


def arm_ik(*arguments: str) -> None:
    subprocess.run([*COMMAND, *arguments], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def solved(name: str, avatar: str, start: int, count: int) -> tuple[Skeleton, list[tuple[RecordedFrame, ArmsState]]]:
    """Frames of a bundled recording with their answers, as somebody else's who begins with frame `start`."""
    session = open_session(bundled_session(name))
    profiles = profiles_for(session)
    answers = islice(solve_frames(session.frames(), profiles, Settings()), start, start + count)
    frames = []
    for seq, (recorded, state) in enumerate(answers):
        times = {"seq": seq, "sample_time_ns": round(seq * 1e9 / RATE_HZ)}
        frames.append(
            (
                recorded._replace(frame=msgspec.structs.replace(recorded.frame, **times)),
                msgspec.structs.replace(state, avatar=avatar, **times),
            )
        )
    return skeleton_of(avatar, profiles[session.avatars[0]]), frames


def view(folder: Path, work: Path, _avatar: Path | None) -> None:
    """The whole window, live: a service, a viewer, a recording that is replayed."""
    arm_ik("demo", "boxing", "--save", str(work / "boxing.rrd"))
    save(shot(work / "boxing.rrd", 545), folder / "view.png")


def overlays(folder: Path, work: Path, _avatar: Path | None) -> None:
    """What explains an arm."""
    skeleton, frames = solved("boxing", "ann", 0, 545)
    path = work / "overlays.rrd"
    with RerunView(Save(path), show=frozenset(OVERLAYS), comfort=ElbowComforts()) as one:
        one.describe(skeleton)
        for recorded, state in frames:
            one.add(state, recorded.frame)
    save(part_of(people_of(shot(path, width=2000, height=1100)), (0.0, 0.0, 1.0, 1.0), 900), folder / "overlays.png")


def skinning(folder: Path, work: Path, _avatar: Path | None) -> None:
    """The built-in arm bent by 120 degrees and pronated by 80, with both skinnings."""
    bent = Arm(abduction=85.0, twist=-80.0, elbow=120.0, pronation=165.0)
    pictures = []
    for how in ("linear", "dual_quaternion"):
        path = work / f"{how}.rrd"
        with RerunView(Save(path), skin=Skin(load_built_in_arms(), how)) as one:
            one.add(person(bent, bent), None)
        pictures.append(part_of(people_of(shot(path, width=3200, height=1800)), (0.52, 0.1, 0.86, 0.55), 560))
    save(beside(pictures, ("linear", "dual quaternion")), folder / "skinning.png")


def avatar(folder: Path, work: Path, avatar: Path | None) -> None:
    """Somebody else's humanoid moved by a bundled recording."""
    if avatar is None:
        print("avatar.png: left out, as no --avatar is given")
        return
    arm_ik("demo", "reach_and_grab", "--avatar", str(avatar), "--save", str(work / "avatar.rrd"))
    save(shot(work / "avatar.rrd", 190), folder / "avatar.png")


def grab(folder: Path, work: Path, _avatar: Path | None) -> None:
    """The scene before, during and after."""
    path = work / "grab.rrd"
    arm_ik("grab", "--fast", "--cube", "0.5,0.8,-3", "--goal=1.0,1.2,-1.6", "--save", str(path))
    moments = {"before": 60, "takes it": 286, "carries it": 380, "after": 690}
    seen: Box = (0.2, 0.17, 0.95, 0.88)
    pictures = [part_of(people_of(shot(path, frame, 2400, 1350)), seen, 400) for frame in moments.values()]
    save(beside(pictures, moments), folder / "grab.png")


def crowd(folder: Path, work: Path, _avatar: Path | None) -> None:
    """Many people at once, live."""
    path, endpoint = work / "crowd.rrd", free_endpoint()
    people = {
        name: [recorded.frame for recorded, _ in solved(RECORDINGS[n % 3], name, 180 + 60 * n, CROWD_FRAMES)[1]]
        for n, name in enumerate(("anna", "ben", "carla", "dan", "eva", "finn", "gita", "hugo", "ines"))
    }
    with (
        part("arm_ik_service", "serve", "--listen", endpoint),
        part("arm_ik_service", "view", "--save", str(path), "--connect", endpoint),
        open_client(BusOptions(connect=(endpoint,)), wait_s=5.0) as bus,
    ):
        streams = {name: declare_stream(bus, Keys().controllers(name), "msgpack") for name in people}
        time.sleep(0.5)  # for the service to be heard of
        start_s = time.monotonic()
        for seq in range(CROWD_FRAMES):
            time.sleep(max(start_s + seq / RATE_HZ - time.monotonic(), 0.0))
            for name, stream in streams.items():
                now_ns = time.time_ns()
                stream.put(codec.encode(msgspec.structs.replace(people[name][seq], publish_time_ns=now_ns)))
        time.sleep(0.5)
    save(shot(path, CROWD_FRAMES - 1), folder / "crowd.png")


PICTURES: dict[str, Callable[[Path, Path, Path | None], None]] = {
    made.__name__: made for made in (view, overlays, skinning, avatar, grab, crowd)
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="where they go")
    parser.add_argument("--avatar", type=Path, help="a .glb, .gltf, .vrm or .obj humanoid")
    parser.add_argument("--only", action="append", choices=PICTURES, help="this one, and others so named")
    options = parser.parse_args()
    for name in options.only or PICTURES:
        with tempfile.TemporaryDirectory() as work:
            PICTURES[name](options.folder, Path(work), options.avatar)


if __name__ == "__main__":
    main()
