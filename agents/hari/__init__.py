"""HARI: an execution policy that understands descriptions, and an intention policy that asks for them (4.3)."""
