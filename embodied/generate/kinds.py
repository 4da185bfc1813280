"""What is usual for each kind of room: the table that program, layout and finishes share."""

from __future__ import annotations

SIZES: dict[str, tuple[float, float, float]] = {
    # kind: smallest and largest usual area (m2), smallest usual side (m)
    "living_room": (15, 54, 3.4),
    "kitchen": (6, 20, 2.1),
    "dining_room": (9, 21, 2.7),
    "main_bedroom": (11, 24, 2.9),
    "bedroom": (8.5, 16, 2.5),
    "kids_room": (9, 16, 2.5),
    "guest_room": (9, 16, 2.6),
    "bathroom": (4, 9.5, 1.7),
    "toilet": (1.7, 3, 1.1),
    "hall": (3, 14, 1.3),
    "corridor": (1.5, 14, 1.1),
    "study": (6.5, 15, 2.2),
    "laundry_room": (3.5, 9, 1.6),
    "pantry": (1.8, 4.5, 1.1),
    "closet": (2.2, 7, 1.3),
    "library": (11, 22, 2.8),
    "playroom": (11, 20, 2.8),
    "gym": (11, 24, 2.8),
    "garage": (17, 38, 3.0),
    "family_room": (13, 28, 3.2),
    "sun_room": (8.5, 18, 2.5),
    "workshop": (8.5, 18, 2.4),
}
BEDROOMS = ("main_bedroom", "bedroom", "kids_room", "guest_room")
