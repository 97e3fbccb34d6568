"""What `arm-ik doctor` looks at. Every finding names what was found and, where it is not well, the cure."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import platform
import shutil
import socket
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Literal, NamedTuple

from arm_ik_service.errors import ArmIkError
from arm_ik_service.io.zenoh_bus import BusOptions, open_client
from arm_ik_service.io.zenoh_streams import living
from arm_ik_service.wire.keys import Keys

State = Literal["well", "note", "ill"]
NEEDED = ("numpy", "pin", "eclipse-zenoh", "rerun-sdk", "numba", "msgspec", "mcap")
EXTRAS = {"cryptography": "security", "pyopenxr": "openxr", "aiohttp": "web"}
SOLVED_WITHIN_US = 2000.0  # an arm pair and frame: a machine slower than this does not keep up with one headset
FREE_MB = 200.0  # for the kernel cache and a minute of recording
SOON_DAYS = 14.0


class Finding(NamedTuple):
    """One thing that was looked at."""

    what: str
    state: State
    found: str
    cure: str = ""


def examine(options: BusOptions, keys: Keys) -> Iterator[Finding]:
    """Look at one thing after the other; what cannot be looked at is a finding too."""
    looks: tuple[tuple[str, Callable[[], Iterator[Finding]]], ...] = (
        ("python", _python),
        ("packages", _packages),
        ("solver", _solver),
        ("disk", _disk),
        ("viewer", _viewer),
        ("certificates", lambda: _certificates(options)),
        ("zenoh", lambda: _zenoh(options, keys)),
    )
    for what, look in looks:
        try:
            yield from look()
        except (ArmIkError, OSError, ImportError) as error:
            yield Finding(what, "ill", str(error), "mend what the message names")


def _python() -> Iterator[Finding]:
    found = f"{platform.python_version()} on {platform.system()} {platform.machine()}, {os.cpu_count()} cores"
    fits = (3, 11) <= sys.version_info[:2] <= (3, 13)
    yield Finding("python", "well" if fits else "ill", found, "" if fits else "use Python 3.11 to 3.13")


def _packages() -> Iterator[Finding]:
    versions, missing = [], []
    for name in NEEDED:
        try:
            versions.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            missing.append(name)
    if missing:
        yield Finding("packages", "ill", f"missing: {', '.join(missing)}", "pip install arm-ik-service")
    else:
        yield Finding("packages", "well", ", ".join(versions))
    without = [extra for name, extra in EXTRAS.items() if not _installed(name)]
    if without:
        yield Finding(
            "extras",
            "note",
            f"not installed: {', '.join(without)}",
            f"pip install 'arm-ik-service[{','.join(without)}]'",
        )


def _installed(name: str) -> bool:
    try:
        importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


def _solver() -> Iterator[Finding]:
    """Load the kernels and time them: from the cache in a second or two, compiled in some 20."""
    from arm_ik_service.avatar import Avatar
    from arm_ik_service.wire.messages import VERSION, ControllerFrame, TrackedPose

    level = (0.0, 0.0, 0.0, 1.0)
    head, left = TrackedPose((0.0, 1.6, 0.0), level), TrackedPose((-0.2, 1.1, -0.3), level)
    frames = [
        ControllerFrame(
            VERSION, n, n * 11_111_111, 0, "stage", head, left, TrackedPose((0.2, 1.1 + 1e-3 * n, -0.3), level)
        )
        for n in range(100)
    ]
    avatar = Avatar()
    began_s = time.perf_counter()
    avatar.step(frames[0], now_ns=0)
    loaded_s = time.perf_counter() - began_s
    began_s = time.perf_counter()
    for frame in frames[1:]:
        avatar.step(frame, now_ns=frame.sample_time_ns)
    each_us = 1e6 * (time.perf_counter() - began_s) / (len(frames) - 1)
    quick = each_us < SOLVED_WITHIN_US
    yield Finding(
        "solver",
        "well" if quick else "ill",
        f"kernels there after {loaded_s:.1f} s, {each_us:.0f} us a frame of both arms",
        "" if quick else "unset NUMBA_DISABLE_JIT, or give the process a core of its own",
    )
    cache = os.environ.get("NUMBA_CACHE_DIR")
    spec = importlib.util.find_spec("arm_ik_service")
    folder = Path(cache) if cache else Path(spec.origin).parent if spec and spec.origin else Path()
    if os.access(folder, os.W_OK):
        yield Finding("kernel cache", "well", f"under {folder}" + ("" if cache else ", in __pycache__"))
    else:
        cure = "set NUMBA_CACHE_DIR to a folder that can be written: every start compiles otherwise"
        yield Finding("kernel cache", "note", f"{folder} cannot be written", cure)


def _disk() -> Iterator[Finding]:
    folder = Path(tempfile.gettempdir())
    free_mb = shutil.disk_usage(folder).free / 1e6
    enough = free_mb > FREE_MB
    yield Finding(
        "disk", "well" if enough else "ill", f"{free_mb:.0f} MB free in {folder}", "" if enough else "make room there"
    )


def _viewer() -> Iterator[Finding]:
    display = sys.platform in ("win32", "darwin") or bool(
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    )
    beside = Path(sys.executable).parent / "rerun"
    found = shutil.which("rerun") or (str(beside) if beside.is_file() else None)
    if found is None:
        yield Finding("viewer", "note", "no rerun on the path", "pip install rerun-sdk")
    elif not display:
        yield Finding("viewer", "note", f"{found}, but no display", "arm-ik view --web, or --save FILE.rrd")
    else:
        yield Finding("viewer", "well", found)


def _certificates(options: BusOptions) -> Iterator[Finding]:
    if options.tls is None:
        return
    from arm_ik_service.io.certificates import days_left

    for path in (options.tls.certificate, options.tls.authority):
        days = days_left(path)
        cure = "" if days > SOON_DAYS else "delete the certificate and its key, and run arm-ik certificates again"
        yield Finding("certificate", "well" if days > SOON_DAYS else "ill", f"{path}: valid for {days:.0f} days", cure)


def _zenoh(options: BusOptions, keys: Keys) -> Iterator[Finding]:
    for endpoint in options.connects_to():
        yield _port(endpoint)
    try:
        with open_client(options, wait_s=0.0) as bus:
            services = [keys.service_of(key) for key in living(bus, keys.liveliness())]
    except ArmIkError as error:
        yield Finding("zenoh", "ill", str(error), "start `arm-ik serve` there, or say where it is with --connect")
        return
    if services:
        yield Finding("services", "well", ", ".join(sorted(services)))
    else:
        yield Finding(
            "services", "ill", "Zenoh answers, but no service of ours", "start `arm-ik serve`; same --prefix?"
        )


def _port(endpoint: str) -> Finding:
    """Whether anybody listens: tells a service that is not there from one that does not let us in."""
    protocol, _, address = endpoint.partition("/")
    host, _, port = address.rpartition(":")
    if protocol not in ("tcp", "tls", "ws") or not port.isdigit():
        return Finding("port", "note", f"{endpoint} is not looked at")
    try:
        with socket.create_connection((host.strip("[]"), int(port)), timeout=2.0):
            return Finding("port", "well", f"{address} is open")
    except OSError as error:
        cure = "start `arm-ik serve` there; for other machines with --listen tcp/0.0.0.0:7447, and open the firewall"
        return Finding("port", "ill", f"{address}: {error.strerror or error}", cure)
