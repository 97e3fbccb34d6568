"""A web page that a headset's browser opens: poses out over a WebSocket, both arms back and drawn in VR.

The server is the only importer of aiohttp. `page/` is what it serves: static files of our own, no third-party source.
"""
