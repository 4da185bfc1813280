"""The plan of a data set: its houses and splits, by kind of task and size."""

from embodied.kinds.splits import DATASET_SCALES, PAPER, SMALL_SCALES, DatasetSize, SplitPlan, Splits
from embodied.kinds.task_kind import kind_named

OOD = "test_ood"
"""The split of houses out of distribution: models, looks, speakers and words that occur in no other split."""


def scale(size: str | DatasetSize, kind: str, ood: int = 0) -> Splits:
    """The houses and splits of a kind of task.

    Args:
      size: one of DATASET_SCALES, or a size of one's own.
      ood: houses out of distribution, with as many tasks each as the others to test in (split 'test_ood').

    Raises:
      ValueError: an unknown scale or kind, one that the kind does not have, or a negative number of houses.
    """
    if ood < 0:
        raise ValueError(f"the number of houses out of distribution should not be negative, got {ood}")
    known = kind_named(kind)
    if known.splits is None:
        raise ValueError(f"there are no data sets of kind {kind!r}; its houses come from seeds")
    if isinstance(size, DatasetSize):
        houses, splits = known.splits(size.sizes)
    elif size in SMALL_SCALES:
        houses, splits = known.splits(SMALL_SCALES[size])
    elif size != PAPER:
        raise ValueError(f"unknown scale {size!r}; use one of {DATASET_SCALES}, or a DatasetSize")
    elif known.paper is None:
        raise ValueError(f"no paper says how large data sets of kind {kind!r} are; use one of {[*SMALL_SCALES]}")
    else:
        houses, splits = known.paper
    if ood:
        unseen = next(s for s in splits if s.group == "test")
        more = SplitPlan(OOD, "ood", round(unseen.tasks / houses["test"] * ood), unseen.part)
        houses, splits = {**houses, "ood": ood}, (*splits, more)
    return Splits(dict(houses), splits)


def quota(total: int, houses: int, index: int) -> int:
    """How many of `total` tasks the house number `index` of `houses` gives: an even share."""
    return total // houses + (index < total % houses)
