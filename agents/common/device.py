"""Where PyTorch computes."""

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
