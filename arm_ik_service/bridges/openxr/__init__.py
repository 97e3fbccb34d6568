"""A headless OpenXR session: head and grips of the runtime that is installed, published as controller frames.

`pyopenxr.py` speaks to the runtime and decides nothing; the rest decides and never imports `xr`.
"""
