"""HouseConfig: what a caller may fix about a house; everything left out is drawn from the seed."""

from dataclasses import dataclass

from embodied.generate.novelty import styles_of
from embodied.house.house import LANDSCAPES, SEASONS, WEATHERS, HouseError
from embodied.house.validation import STYLES
from embodied.seeds import NOVELTIES

SPECIAL = ("L", "bay", "gallery", "attic")
SHAPES = ("rectangle", "L", "T", "U", "cross")
CHOICES = {
    "weather": WEATHERS,
    "landscape": LANDSCAPES,
    "season": SEASONS,
    "style": STYLES,
    "novelty": NOVELTIES,
    "shape": SHAPES,
}
"""Field of a HouseConfig to the words it may be."""
AREAS = (32.0, 700.0)
"""Smallest and largest total area, square metres."""

OTHERS = 14
"""How many main rooms besides bedrooms a house may have."""


class DeadEndError(HouseError):
    """A stage found no way on; another house of the same seed may have one."""


@dataclass(frozen=True)
class Retries:
    """How often each step of generation is drawn anew at most; nothing else in it is tried again."""

    house: int = 16
    """Plans: while none is walkable, no doors leave every room open, a room stays closed, or one lacks what it must
    have."""
    doors: int = 8
    """Doors and windows of one plan: while a leaf shuts a room off."""
    room: int = 6
    """Furniture of one room: while it lacks something (RoomSpec.needs)."""
    fillers: int = 8
    """Groups that are added to one room while it looks bare."""
    clearing: int = 8
    """Rounds in which what blocks the ways is taken out."""


RETRIES = Retries()


@dataclass(frozen=True)
class HouseConfig:
    """The knobs of the generator. None means: draw it from the seed.

    Examples:
      >>> config = embodied.HouseConfig(area=(38, 46), hour=17.5)
    """

    area: tuple[float, float] | None = None
    """Lowest and highest floor area in square metres, drawn uniformly between them."""
    rooms: int | None = None
    """Number of main rooms, 2 to 20; kitchen, bathrooms, storage, garage and corridors do not count."""
    bedrooms: int | None = None
    """Number of bedrooms (main, children's, guest), 1 to 12."""
    shape: str | None = None
    """Shape of the floor plan."""
    storeys: int | None = None
    """Number of storeys, 1 to 3; `area`, `rooms` and `bedrooms` are of all of them. None: some houses above 110 m2 have
    two, and some above 220 m2 three."""
    special: tuple[str, ...] | None = None
    """Rooms that are no boxes, where there is a place for them: L, living and dining room as one; bay, a bay window;
    gallery, a stairwell that is open to the storey above; attic, a highest storey under the roof. None: houses of
    several storeys may have the first three."""
    open_plan: bool | None = None
    """Connect kitchen, dining and living room by wide openings."""
    style: str | None = None
    """Style of materials and furniture."""
    disorder: float | None = None
    """Disorder, from 0 (tidy) to 1 (thoroughly lived in)."""
    hour: float | None = None
    """Local solar time, hours in [0, 24)."""
    weather: str | None = None
    """Weather, which decides the light from the sky."""
    landscape: str | None = None
    """Scenery that the windows show."""
    season: str | None = None
    """Season of the landscape (leaves, bare trees, snow)."""
    novelty: str | None = None
    """For tests out of distribution: 'familiar' restricts a house to what training houses hold, 'novel' to what they
    never hold (embodied.generate.novelty); None: no restriction."""

    def __post_init__(self) -> None:
        if self.area is not None:
            try:
                low, high = (float(a) for a in self.area)
            except (TypeError, ValueError):
                raise HouseError(f"area should be a pair (low, high) of m2, got {self.area!r}") from None
            if not AREAS[0] <= low <= high <= AREAS[1]:
                raise HouseError(f"area should be (low, high) within {AREAS} m2, got {self.area}")
        if unknown := set(self.special or ()) - set(SPECIAL):
            raise HouseError(f"special should be some of {SPECIAL}, got {sorted(unknown)}")
        _within("rooms", self.rooms, 2, 20)
        _within("bedrooms", self.bedrooms, 1, 12)
        _within("storeys", self.storeys, 1, 3)
        _within("disorder", self.disorder, 0, 1)
        if self.hour is not None and not 0 <= self.hour < 24:
            raise HouseError(f"hour should lie in [0, 24), got {self.hour}")
        for name, known in CHOICES.items():
            if (value := getattr(self, name)) not in (None, *known):
                raise HouseError(f"{name} should be one of {known}, got {value!r}")
        if self.style is not None and self.style not in styles_of(self.novelty):
            raise HouseError(
                f"{self.novelty} houses have the styles {styles_of(self.novelty)}, got {self.style!r}; leave style out"
            )
        if self.rooms is not None and self.bedrooms is not None and self.bedrooms > self.rooms - 1:
            raise HouseError(
                f"{self.bedrooms} bedrooms do not fit in {self.rooms} main rooms, one of which is "
                "the living room; raise rooms or lower bedrooms"
            )
        if self.rooms is not None and self.bedrooms is not None and self.rooms - self.bedrooms > OTHERS:
            raise HouseError(
                f"{self.rooms} main rooms with only {self.bedrooms} bedrooms leave more than {OTHERS} other "
                "rooms to invent; lower rooms or raise bedrooms"
            )
        needed = self.least_area()
        if self.area is not None and self.area[1] < needed:
            raise HouseError(
                f"rooms={self.rooms}, bedrooms={self.bedrooms}, shape={self.shape!r}, storeys={self.storeys} need at "
                f"least {needed:.0f} m2, area allows {self.area[1]:.0f}; raise area or ask for fewer rooms"
            )
        if self.area is not None and self.rooms is not None and self.area[0] > self.most_area():
            raise HouseError(
                f"rooms={self.rooms} fill at most {self.most_area():.0f} m2, area asks for "
                f"{self.area[0]:.0f}; lower area or ask for more rooms"
            )

    def least_area(self) -> float:
        """The smallest total area, square metres, that holds what is asked for."""
        rooms = max(self.rooms or 2, (self.bedrooms or 1) + 1)
        shape = {"L": 75.0, "T": 95.0, "U": 150.0, "cross": 210.0}.get(self.shape or "", 0.0)
        storeys = self.storeys or 1
        storey = max(shape, (0.0, 45.0, 55.0)[storeys - 1])
        return max(AREAS[0] + 17.0 * (rooms - 2), storey * storeys)

    def most_area(self) -> float:
        """The largest total area, square metres, that the asked number of main rooms can fill sensibly."""
        return AREAS[1] if self.rooms is None else 45.0 * self.rooms + 10.0


def _within(name: str, value: float | None, low: float, high: float) -> None:
    if value is not None and not low <= value <= high:
        raise HouseError(f"{name} should lie between {low} and {high}, got {value}")
