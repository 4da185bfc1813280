"""Procedural, physically scaled, seamlessly tileable materials."""
