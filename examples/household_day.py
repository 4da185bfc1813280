"""A day of a household: who is where at which hour, doing what, and the walks between, through doors.

    python examples/household_day.py --seed 7 --at 18:30

prints the day of a small flat, and draws who is there at a time (lit, `household_day.png`).
"""

from __future__ import annotations

import argparse
import math

import cv2
import numpy as np

import embodied
from embodied.house.shapes import room_at


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--at", help="'18:30': draw the house then")
    args = parser.parse_args()
    house = embodied.generate_house(args.seed, embodied.HouseConfig(area=(38, 46)))
    day = embodied.day_of(house, embodied.load_catalogue(embodied.default_cache()), seed=args.seed)
    for name, pieces in day.pieces.items():
        print(f"{name} is {day.figures[name].id}, {day.figures[name].words}")
        for piece in pieces:
            if piece.leg is None and piece.settled[0] == piece.settled[1]:
                hour, minute = divmod(int(piece.begin) // 60, 60)
                print(f"  {hour:02d}:{minute:02d} {piece.spot.activity} {piece.spot.thing}")
    if args.at is not None:
        with embodied.open_world(house, pictures="fast-matte").at(args.at, seed=args.seed) as world:
            at = {name: np.array(person.place.position) for name, person in world.moment.people.items()}
            for name, place in at.items():
                print(f"{args.at}: {name} is in {room_at(house, place + (0, 0, 0.5))}")
            to = next(iter(at.values()), world.graph.positions[0] - (0, 0, 1.5))
            eyes, room = zip(world.graph.positions, world.graph.room_of_node), room_at(house, to + (0, 0, 0.5))
            eye = min(eyes, key=lambda e: (e[1] != room, abs(math.dist(e[0][:2], to[:2]) - 2.0)))[0]
            view = world.camera(eye, math.atan2(*(to - eye)[1::-1]), -0.35, 1.2, (480, 640))
            cv2.imwrite("household_day.png", view.rgb[..., ::-1])


if __name__ == "__main__":
    main()
