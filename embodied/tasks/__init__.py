"""Tasks: who is asked to do what, sampled as pure functions of (seed, world, index)."""
