"""Whether anybody walks through anything on a day of a household; not collected by pytest.

python tests/hand_days.py 0 100    days in houses of seeds 0 to 99: flats, and every fifth a house of two storeys
"""

import sys
from collections import Counter

import numpy as np
from test_days import CATALOGUE, off_and_near

from embodied.generate import HouseConfig, generate_house
from embodied.people.day import day_of

AREAS, SECONDS = ((38, 46), (60, 80), (90, 130)), 0.25

total = Counter[str]()
for seed in range(*map(int, sys.argv[1:3])):
    config = HouseConfig(area=AREAS[seed % 3]) if seed % 5 else HouseConfig(area=(90, 120), storeys=2)
    house = generate_house(seed, config, CATALOGUE)
    lives, floors, heights = day_of(house, CATALOGUE, seed=seed), {}, [s.elevation for s in house.storeys]
    total.update(days=1, people=len(lives.pieces), doors=len(lives.doors))
    for name, p in ((name, p) for name, own in lives.pieces.items() for p in own if p.leg is not None):
        total["walks"] += 1
        for t in np.arange(p.begin, p.end, SECONDS).tolist():
            off, near = off_and_near(lives, name, t, floors)
            on_stairs = np.abs(p.leg.place(t)[0][2] - heights).min() > 0.01
            total.update(moments=1, on_stairs=int(on_stairs), off_the_floor=off, near_another=near)
    print(seed, config.area, dict(total), flush=True)
