"""embodied: generated houses in MuJoCo, panoramas, and agents that ask people for help."""
