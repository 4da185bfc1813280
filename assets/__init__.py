"""Furniture and materials: asset packs, the catalogue over them, procedural materials."""
