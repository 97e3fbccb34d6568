"""Programs that publish controller frames: a native OpenXR session, and a web page for a headset's own browser."""
