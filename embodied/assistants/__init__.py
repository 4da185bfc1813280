"""Assistants: part of the world, present at test time, answering what the agent asks."""
