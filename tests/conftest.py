from __future__ import annotations

from hypothesis import settings

settings.register_profile("fastmech", derandomize=True, deadline=None)
settings.load_profile("fastmech")
