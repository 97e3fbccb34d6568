"""MCAP recordings: one channel a key expression, JSON messages with their JSON Schema inside; any MCAP tool reads them.

A recorder may be killed at any moment. So chunks are small and handed to the operating system once a second, and the
reader needs neither index nor end: it walks the records from the front, and what is whole up to the first byte that is
not, is the recording.
"""

from __future__ import annotations

from arm_ik_service.io.recording.reader import Recording, open_recording
from arm_ik_service.io.recording.writer import RecordingWriter

__all__ = ["Recording", "RecordingWriter", "open_recording"]
