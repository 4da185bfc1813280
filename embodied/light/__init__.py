"""Light once, look many times: a house's global illumination baked into textures."""

from embodied.light.backend import LightError as LightError
from embodied.light.baking.house import bake as bake
from embodied.light.baking.house import bake_all as bake_all
from embodied.light.baking.house import duration as duration
from embodied.light.baking.house import lightings_of as lightings_of
from embodied.light.baking.house import progress_bar as progress_bar
from embodied.light.pages.files import Bake as Bake
from embodied.light.pages.files import StaleBake as StaleBake
from embodied.light.pages.files import open_bake as open_bake
from embodied.light.settings import QUALITIES as QUALITIES
from embodied.light.settings import LightSettings as LightSettings
from embodied.light.settings import settings_of as settings_of
