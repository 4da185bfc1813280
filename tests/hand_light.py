"""How light is computed in tests: coarsely and with few rays."""

from __future__ import annotations

from embodied.light.settings import LightSettings

RAYS = {"sky_rays": 12, "lamp_rays": 12, "other_rays": 12, "sun_rays": 4, "bounce_rays": 8, "seen_rays": 24}
TINY = LightSettings(12.0, 400.0, **RAYS, patches=16, rows=512, jpeg=90)
