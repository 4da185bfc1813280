"""Light on bodies in MuJoCo's own viewer and renderer, which know no probes: one colour a geom."""

import mujoco
import numpy as np

from embodied.house.house import House
from embodied.house.shapes import room_at
from embodied.light.pages.colours import linear
from embodied.light.pages.files import Bake
from embodied.light.pages.tone import displayed
from embodied.scene.bodies import geom_color
from embodied.scene.model import PROBE_LIT

MEAN_TERM = 0.2820947918
"""The first harmonic, of which the mean over all directions consists."""


class ViewerLight:
    """Owns the colours of all bodies that were attached to the MjModel of a lit house (`build_spec(lit=...)` or an
    exported house.xml): what they have of their own, and what they have in the light around them.

    An approximation: a geom shines everywhere in the colour that the room's probes give it, as a mean over all
    directions; there is no sun, no shadow and no reflection. `World.follow` draws all of these.

    Examples:
      >>> light = ViewerLight(model, world.baked(), house)
      >>> mujoco.mj_step(model, data)
      >>> light.shine(data)
    """

    def __init__(self, model: mujoco.MjModel, bake: Bake, house: House) -> None:
        """
        Raises:
          ValueError: the model is not that of a lit house.
        """
        self._model, self._bake, self._house = model, bake, house
        shining = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_MATERIAL, PROBE_LIT)
        if shining < 0:
            raise ValueError(f"the model has no material {PROBE_LIT!r}; build it by build_spec(..., lit=...) first")
        material = model.geom_matid  # pages of the house and lamps have light of their own, on leaves of doors, too
        lit = (material >= 0) & (model.mat_emission[material] > 0.5)
        self._geoms = np.flatnonzero((model.geom_bodyid > 0) & ~lit)
        self._own = np.array([geom_color(model, int(g)) for g in self._geoms]).reshape(-1, 4)
        for g in self._geoms:
            material = int(model.geom_matid[g])
            if material >= 0 and (model.mat_texid[material] >= 0).any():
                model.mat_emission[material] = 1.0
            else:
                model.geom_matid[g] = shining
        self._last = np.full((len(self._geoms), 3), np.inf)

    def shine(self, data: mujoco.MjData, *, slack: float = 0.05) -> None:
        """Give the geoms the light of where they are now.

        Args:
          slack: metres that a geom may have moved since, to keep its colour.
        """
        there = data.geom_xpos[self._geoms]
        moved = np.flatnonzero(np.linalg.norm(there - self._last, axis=1) > slack)
        for k in moved:
            room = room_at(self._house, there[k])
            if room is not None:
                mean = self._bake.probes.at(there[k : k + 1], room)[0, 0] * MEAN_TERM
                exposed = np.maximum(mean, 0) * self._bake.exposure.near(there[k : k + 1])[0]
                color = displayed(linear(self._own[k, :3]).astype(np.float32)[None] * exposed)[0] / 255
                self._model.geom_rgba[self._geoms[k]] = [*color, self._own[k, 3]]
        self._last[moved] = there[moved]
