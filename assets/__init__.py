"""What the world is made of: asset packs, the catalogue over them, procedural materials."""
