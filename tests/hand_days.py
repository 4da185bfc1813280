"""Whether anybody walks through anything on a day of a household; not collected by pytest.

python tests/hand_days.py 0 100    days in houses of seeds 0 to 99: flats, and every fifth a house of two storeys
"""

import sys
from collections import Counter

import numpy as np
import shapely
from test_days import CATALOGUE, floor_of

from embodied.generate import HouseConfig, generate_house
from embodied.navigation.graph import AGENT_RADIUS
from embodied.people.day import day_of

AREAS, SECONDS = ((38, 46), (60, 80), (90, 130)), 0.25


def main(first: int, last: int) -> None:
    total = Counter[str]()
    for seed in range(first, last):
        config = HouseConfig(area=AREAS[seed % 3]) if seed % 5 else HouseConfig(area=(90, 120), storeys=2)
        house = generate_house(seed, config, CATALOGUE)
        lives, floors = day_of(house, CATALOGUE, seed=seed), {}
        walks = [(name, p) for name, own in lives.pieces.items() for p in own if p.leg is not None]
        total.update(days=1, people=len(lives.pieces), doors=len(lives.doors), walks=len(walks))
        for name, p in walks:
            for t in np.arange(p.begin, p.end, SECONDS):
                moment = lives.at(float(t))
                feet = {n: f.place.position for n, f in moment.people.items()}
                x, y, z = p.leg.bearing(float(t)).position.tolist()
                key = round(z, 1), *moment.openness.items()
                if key not in floors:
                    floors[key] = floor_of(house, moment, z).buffer(1e-4)
                    shapely.prepare(floors[key])
                at, others = feet[name], [f for n, f in feet.items() if n != name]
                off = not floors[key].covers(shapely.Point(at[:2]).buffer(AGENT_RADIUS - 0.01))
                near = any(np.hypot(*np.subtract(at, o)[:2]) < 0.4 and abs(at[2] - o[2]) < 1.5 for o in others)
                on_stairs = all(abs(s.elevation - z) > 0.01 for s in house.storeys)
                total.update(moments=1, on_stairs=on_stairs, off_the_floor=off, near_another=near)
                if off or near:
                    print(seed, name, round(float(t), 2), p.spot.activity, "off the floor" * off, "near" * near)
        print(seed, config.area, dict(total), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
