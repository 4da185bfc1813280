"""Data sets: houses, graphs, routes and tasks of one kind of play, split by house."""
