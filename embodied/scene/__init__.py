"""A house as meshes and as an MjModel."""
