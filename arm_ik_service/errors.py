"""The error tree. Building fails loudly with one of these; running holds and counts instead.

    ArmIkError
    ├── SettingsError        a settings file or option that cannot be used
    ├── ProfileError         a calibration profile that cannot be used
    │   └── CalibrationError frames that no profile can be made from; says what to do differently
    ├── ModelError           an arm model that cannot be loaded or scaled
    ├── WireError            bytes that are not one of our messages
    │   ├── DecodeError      malformed, wrong shape or type; names the path of the field
    │   └── VersionError     a version of the message that this program does not speak
    ├── SessionError         a recording that cannot be read or written
    ├── SkinError            an avatar file whose mesh or bones cannot be used
    ├── BusError             Zenoh could not be opened or reached
    ├── ViewError            Rerun could not be started or reached
    └── BridgeError          a bridge cannot run: no OpenXR runtime, no headless session, no port, no certificate

Every message names the cause and, where one is known, the cure; the data is on the error as attributes.
"""

from __future__ import annotations


class ArmIkError(Exception):
    """Any failure that a user can understand and mend. The command line prints it as one line and exits with 2."""


class SettingsError(ArmIkError):
    """A settings file or option that cannot be used."""


class ProfileError(ArmIkError):
    """A calibration profile that cannot be used."""


class CalibrationError(ProfileError):
    """Frames that no profile can be made from: no T-pose, too little movement, nobody there."""


class ModelError(ArmIkError):
    """An arm model that cannot be loaded or scaled."""


class WireError(ArmIkError):
    """Bytes that are not one of our messages."""


class DecodeError(WireError):
    """Malformed bytes, or a message of the wrong shape; the text names the path of the field."""


class VersionError(WireError):
    """A message version that this program does not speak."""

    def __init__(self, found: int, spoken: int) -> None:
        self.found = found
        self.spoken = spoken
        super().__init__(f"message version {found}, but this program speaks version {spoken}: update the older side")


class SessionError(ArmIkError):
    """A recording that cannot be read or written; `offset` is the byte where reading failed, if one is known."""

    def __init__(self, message: str, *, offset: int | None = None) -> None:
        self.offset = offset
        super().__init__(message if offset is None else f"{message} (at byte {offset})")


class SkinError(ArmIkError):
    """An avatar file whose mesh or bones cannot be used."""


class BusError(ArmIkError):
    """Zenoh could not be opened or reached."""


class ViewError(ArmIkError):
    """Rerun could not be started or reached."""


class BridgeError(ArmIkError):
    """A bridge cannot run: a runtime, an extension, a port or a certificate is missing."""
