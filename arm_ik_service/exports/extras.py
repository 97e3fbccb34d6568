"""The libraries that only exports need: what to say where one is missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from arm_ik_service.errors import SettingsError

EXTRA = "export"


@contextmanager
def optional_libraries() -> Iterator[None]:
    """Within the block a library that is not installed is a SettingsError that says how to get it."""
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name is None or error.name.startswith("arm_ik_service"):
            raise
        raise SettingsError(
            f"this needs {error.name}, which is not installed: pip install 'arm-ik-service[{EXTRA}]'"
        ) from error
