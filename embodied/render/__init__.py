"""A house as pictures: back ends, visibility, panoramas, sightings."""
