"""People who live in a house: how they move, and what they do all day."""
