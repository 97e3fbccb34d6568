"""Real-time VR arms: headset and controller poses in, two human arms out."""

from __future__ import annotations

__version__ = "0.1.0"
