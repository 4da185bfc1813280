"""Benchmarks: medians of repeated runs, with the machine they were made on. Run by `embodied bench`."""
