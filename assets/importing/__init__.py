"""Importing of furniture in one folder."""
