"""Units of work on a Ray cluster; Ray is an optional extra (`pip install embodied-houses[ray]`)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from embodied.errors import UnableError

RETRIES = 5
"""How often a unit is begun again on another node when the one it ran on dies."""


def run_on_ray(job: Callable[..., str], work: Sequence[Any], arguments: tuple, address: str) -> Iterator[str]:
    """job(unit, *arguments) for every unit, results as they come.

    A unit is pure and is renamed into place when whole, so running it again after a node died,
    or twice at once, gives the same folder. All nodes must see the data set under the same path.

    Args:
      address: of the cluster, or 'local' for one on this machine.

    Raises:
      UnableError: Ray is not installed.
    """
    try:
        import ray
    except ImportError as e:
        raise UnableError(
            "--ray needs Ray; install it with: pip install 'embodied-houses[ray]', or use --workers"
        ) from e
    started = not ray.is_initialized()
    if started:
        ray.init(address=None if address == "local" else address, log_to_driver=False, include_dashboard=False)
    try:
        remote = ray.remote(max_retries=RETRIES, num_cpus=1)(job)
        waiting = [remote.remote(unit, *arguments) for unit in work]
        while waiting:
            done, waiting = ray.wait(waiting, num_returns=1)
            yield ray.get(done[0])
    finally:
        if started:
            ray.shutdown()
