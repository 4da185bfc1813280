"""Learners: vision, models, imitation. Torch lives here and only here."""
