"""From a seed to a House: named stages, each a function from Draft to Draft that can be replaced.

house = generate_house(7)
house = generate_house(7, HouseConfig(area=(300, 340), shape="U"))
bare = generate_house(7, stages={k: s for k, s in STAGES.items() if k != "furnish"})
"""

from embodied.generate.config import HouseConfig
from embodied.generate.stages import STAGES, Draft, generate_house

__all__ = ["STAGES", "Draft", "HouseConfig", "generate_house"]
