"""A real Chromium with the page in it, and an emulated headset where one is asked for."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from bridges.pages import CODE, Served
from harness import wait_for

IWER = "iwer@2.5.0"  # from npm, for the tests alone: a headset in JavaScript
FLAGS = [
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-renderer-backgrounding",  # every tab is a headset in use
    "--disable-backgrounding-occluded-windows",
    "--disable-background-timer-throttling",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
# forceInstall: headless Chromium has a navigator.xr of its own, without a headset. IWER calls the positions of its
# controllers emulated; here it does so only when a test says so.
PUT_ON = """
globalThis.device = new IWER.XRDevice(IWER.metaQuest3);
device.installRuntime({ forceInstall: true });
globalThis.emulated = false;
Object.defineProperty(XRPose.prototype, "emulatedPosition", { get: () => emulated });
"""
# every socket that the page opens, so that a test can cut the newest
KEEP_SOCKETS = """
globalThis.sockets = [];
globalThis.WebSocket = class extends WebSocket {
  constructor(...given) { super(...given); sockets.push(this); }
};
"""


def chromium() -> str:
    """Return the browser's path, or skip."""
    found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if found is None:
        pytest.skip("needs a Chromium: apt-get install chromium")
    return found


def iwer_script() -> Path:
    """Return IWER's script, installed by npm into a temporary folder once, or skip."""
    folder = Path(tempfile.gettempdir()) / f"arm_ik_{IWER.replace('@', '_')}"
    script = folder / "node_modules/iwer/build/iwer.min.js"
    if not script.is_file():
        if shutil.which("npm") is None:
            pytest.skip("needs npm, to fetch the emulated headset")
        folder.mkdir(exist_ok=True)
        got = subprocess.run(["npm", "install", "--no-save", IWER], cwd=folder, capture_output=True, text=True)
        if not script.is_file():
            pytest.skip(f"npm could not fetch {IWER}: {got.stderr.strip().splitlines()[-1:]}")
    return script


class Tab:
    """The page in a browser."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.errors: list[str] = []
        page.set_default_timeout(10_000)
        page.on("pageerror", lambda error: self.errors.append(str(error)))

    def run(self, script: str) -> Any:
        return self.page.evaluate(script)

    def text(self, element: str) -> str:
        return str(self.run(f"document.getElementById('{element}').textContent"))

    def until(self, script: str, seconds: float = 10.0) -> bool:
        """Return whether the expression came true in time."""
        return wait_for(lambda: bool(self.run(script)), seconds)

    @property
    def avatar(self) -> str:
        return str(self.run("armIk.link.avatar"))


class Browser:
    """A running Chromium; every tab is a browser profile of its own, as every headset is."""

    def __init__(self, playwright_browser: Any) -> None:
        self._browser = playwright_browser

    def open(self, served: Served, *, code: str = CODE, headset: bool = False, small: bool = True) -> Tab:
        """Open the page, paired unless the code is wrong; small, because a processor draws it."""
        size = {"width": 960, "height": 540} if small else {"width": 1280, "height": 760}
        context = self._browser.new_context(ignore_https_errors=True, viewport=size)
        context.add_init_script(KEEP_SOCKETS)
        if headset:
            context.add_init_script(iwer_script().read_text() + PUT_ON)
        tab = Tab(context.new_page())
        tab.page.goto(f"{served.origin}/#code={code}")
        return tab

    def open_elsewhere(self, url: str) -> Tab:
        tab = Tab(self._browser.new_context(ignore_https_errors=True).new_page())
        tab.page.goto(url)
        return tab


@contextmanager
def running_browser() -> Iterator[Browser]:
    """Start Chromium headless, or skip with the reason."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="needs the extra browser")
    path = chromium()
    start: Callable[[], Any] = sync_api.sync_playwright
    with start() as playwright:
        browser = playwright.chromium.launch(executable_path=path, headless=True, args=FLAGS)
        yield Browser(browser)
        browser.close()
