"""Names for what Mitsuba and Dr.Jit compute with, which have no static types: signatures say what they hold.

Which classes these are is known at run time only (backend.mitsuba, backend.drjit).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

Array: TypeAlias = Any
"""Numbers of n rays or points, or (c, n) vectors; a Python number or True fits all of them."""
Ray: TypeAlias = Any
"""n rays: origins and directions (3, n)."""
RayScene: TypeAlias = Any
"""Triangles that rays can be put to."""
Triple: TypeAlias = Sequence[float] | np.ndarray
"""(3,) numbers: a place in metres or a direction, world."""
