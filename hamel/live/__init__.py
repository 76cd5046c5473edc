"""Pages that compute: the module as WebAssembly inside the page, with sliders for parameters,
initial values and inputs."""

from hamel.live.page import Live, live_of, page

__all__ = ["Live", "live_of", "page"]
