"""Paths of the weights that ship with this repository; agents/weights/README.md says how they were made."""

from __future__ import annotations

from pathlib import Path

WEIGHTS = Path(__file__).resolve().parent.parent / "weights"
SHIPPED_ENCODER, SHIPPED_AGENT = WEIGHTS / "encoder.safetensors", WEIGHTS / "hanna_mini.safetensors"
SHIPPED_DETECTOR = WEIGHTS / "detector.safetensors"
"""Of the shipped encoder."""
SHIPPED_HARI = WEIGHTS / "hari_mini.safetensors"
SHIPPED_VNLA, SHIPPED_VLN = WEIGHTS / "vnla_mini.safetensors", WEIGHTS / "vln_mini.safetensors"
SHIPPED_STUDENT = WEIGHTS / "iliad_regex_tiny.safetensors"
SHIPPED_WALKER = WEIGHTS / "iliad_nav_mini.safetensors"
