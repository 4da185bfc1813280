"""Kinds of tasks: their record and registry, what their tables share, and those that come with the program."""
