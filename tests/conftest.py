"""What every test shares: a kernel cache that belongs to exactly these sources, and where the recordings are."""

from __future__ import annotations

import hashlib
import os
import tempfile
from pathlib import Path

import pytest
from hypothesis import settings

ROOT = Path(__file__).parent.parent


def _kernel_cache() -> Path:
    """Return a cache folder named by the sources: numba does not notice a change in a callee in another file."""
    import importlib.util

    spec = importlib.util.find_spec("arm_ik_service")
    assert spec is not None
    assert spec.origin is not None
    digest = hashlib.sha256()
    for path in sorted(Path(spec.origin).parent.rglob("*.py")):
        if "@compiled" in (text := path.read_text()):
            digest.update(text.encode())
    return Path(tempfile.gettempdir()) / f"arm_ik_kernels_{digest.hexdigest()[:16]}"


os.environ.setdefault("NUMBA_CACHE_DIR", str(_kernel_cache()))


# The first call of a compiled function compiles it: no deadline an example could honestly keep.
settings.register_profile("arm_ik", deadline=None)
settings.load_profile("arm_ik")


@pytest.fixture(scope="session")
def recordings() -> Path:
    """The folder of real recordings that lies beside a developer's checkout and is not part of the project."""
    folder = ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("needs the real recordings, ../shared/data, which are not part of the project")
    return folder
