"""A house as plain data: its record, its floor plan, its validation."""
