"""What every test shares: where the recordings are."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import settings

ROOT = Path(__file__).parent.parent


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
