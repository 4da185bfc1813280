"""Devices on which PyTorch computes, with how many threads, and in how many processes: of several that make one run,
each plays a share of every batch, and gradients are added up.

Started by PyTorch's own launcher, `torchrun --nproc-per-node 4 --no-python embodied train hanna ...`.
The batch of the settings is the whole batch, so results do not depend on the number of processes
but for rounding and for the draws of dropout.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import TypeVar

import torch
import torch.distributed as dist

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


T = TypeVar("T")


def rank() -> int:
    """Number of this process, 0 without others."""
    return dist.get_rank() if dist.is_initialized() else 0


def world_size() -> int:
    return dist.get_world_size() if dist.is_initialized() else 1


def join_launcher(device: str) -> str:
    """Join the other processes if torchrun started this one; returns the device to use.

    Raises:
      UnableError: there is no such device.
    """
    check_device(device)
    if not dist.is_torchelastic_launched():
        return device
    dist.init_process_group("nccl" if device.startswith("cuda") else "gloo")
    return f"cuda:{dist.get_node_local_rank()}" if device == "cuda" else device


def share(items: Sequence[T]) -> Sequence[T]:
    """The share of this process: every n-th item."""
    return items[rank() :: world_size()]


def add_gradients(parameters: Iterable[torch.nn.Parameter]) -> None:
    """Every process gets the sum of all gradients."""
    if world_size() == 1:
        return
    gradients = [p.grad for p in parameters if p.grad is not None]
    flat = torch.cat([g.flatten() for g in gradients])
    dist.all_reduce(flat)
    at = 0
    for g in gradients:
        g.copy_(flat[at : at + g.numel()].view_as(g))
        at += g.numel()


def reduce_metrics(
    numbers: Mapping[str, float], names: Sequence[str], added: Collection[str], device: torch.device
) -> dict[str, float]:
    """`numbers` of all processes, each named in `names`: those in `added` summed up, of the others the mean over
    the processes that have them."""
    if world_size() == 1:
        return dict(numbers)
    table = torch.tensor([[numbers.get(n, 0.0), float(n in numbers)] for n in names], device=device)
    dist.all_reduce(table)
    return {
        n: total / (1 if n in added else count)
        for n, (total, count) in zip(names, table.tolist(), strict=True)
        if count
    }


def rank_zero(note: Callable[[str], None]) -> Callable[[str], None]:
    """`note` in the first process, silence in the others."""
    return note if rank() == 0 else lambda line: None


def any_rank(flag: bool, device: torch.device) -> bool:
    """True if `flag` is true in any process, so that all stop together."""
    if world_size() == 1:
        return flag
    tensor = torch.tensor(float(flag), device=device)
    dist.all_reduce(tensor, dist.ReduceOp.MAX)
    return bool(tensor.item())
