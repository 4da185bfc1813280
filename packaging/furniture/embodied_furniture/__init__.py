"""Furniture libraries (.sh3f) of embodied-houses, found by that package; there is nothing to import."""
