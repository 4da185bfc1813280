"""Answers to rays: sky, lamps and surfaces as rays meet them, how light goes between them, and the path tracer."""
