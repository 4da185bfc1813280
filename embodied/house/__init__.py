"""A house as plain data: its record, its floor plan, its validation."""

from embodied.house.house import House as House
