"""Devices on which PyTorch computes, with how many threads."""

from __future__ import annotations

import torch

from embodied.errors import UnableError


def check_device(device: str) -> None:
    """Refuse a device that PyTorch cannot use here.

    Raises:
      UnableError: it is none, or there is no GPU.
    """
    try:
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as e:
        raise UnableError(f"--device {device} cannot be used here ({str(e).splitlines()[0]}); use --device cpu") from e


def use_threads(threads: int) -> None:
    """Let PyTorch use so many threads on the CPU.

    Raises:
      ValueError: fewer than one.
    """
    if threads < 1:
        raise ValueError(f"--threads should be at least 1, got {threads}")
    torch.set_num_threads(threads)
