"""The rules of play: what happens when an agent moves, asks or stops."""
