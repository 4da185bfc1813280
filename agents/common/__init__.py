"""Retrospective DAgger for help-asking agents (dissertation 4.2.3)."""
