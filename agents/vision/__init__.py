"""Pixels to features: residual networks, their training on our own renders, 36 x D features."""
