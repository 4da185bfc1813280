"""How large data sets are: houses and tasks of each split, by a named scale or by sizes of one's own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True)
class SplitPlan:
    """One split: the houses it draws from and how many tasks it wants."""

    name: str
    group: str
    """The group of houses: 'train', 'extra', 'val', 'test' or 'ood'. A 'seen' split shares 'train'."""
    tasks: int
    part: str = "main"
    """The part of each house's pool: 'main', 'val' or 'test' (held out), or a part that the kind itself names."""
    groups: tuple[str, ...] = ()
    """More groups it draws from, besides `group`."""

    @property
    def all_groups(self) -> tuple[str, ...]:
        return (self.group, *self.groups)


@dataclass(frozen=True)
class SplitSizes:
    """Numbers that the splits of a data set are made of, unless a paper has its own."""

    houses: Mapping[str, int]
    """Number of houses to train in ('train'), to train in where a kind wants more of them ('extra'), to validate in
    ('val') and to test in ('test')."""
    tasks: int
    """Training tasks."""
    unseen: int
    """Tasks in the houses to test in; the other splits to evaluate in have a half or, HARI's, a third as many."""
    each: int | None = None
    """Instead, tasks of every split to evaluate in."""


class Splits(NamedTuple):
    """The houses and splits of a data set."""

    houses: Mapping[str, int]
    """Group to number of houses."""
    splits: tuple[SplitPlan, ...]


def five_splits(train: int, val_seen: int, val_unseen: int, test_seen: int, test_unseen: int) -> tuple[SplitPlan, ...]:
    """Training, and validation and test in seen and in unseen houses, by their numbers of tasks."""
    return (
        SplitPlan("train", "train", train),
        SplitPlan("val_seen", "train", val_seen, "val"),
        SplitPlan("val_unseen", "val", val_unseen),
        SplitPlan("test_seen", "train", test_seen, "test"),
        SplitPlan("test_unseen", "test", test_unseen),
    )


def seen_and_unseen(sizes: SplitSizes) -> Splits:
    """The splits of most kinds."""
    held, tested = sizes.each or max(1, sizes.unseen // 2), sizes.each or sizes.unseen
    houses = {group: sizes.houses[group] for group in ("train", "val", "test")}
    return Splits(houses, five_splits(sizes.tasks, held, held, held, tested))


def _small(train: int, extra: int, val: int, test: int, tasks: int, unseen: int) -> SplitSizes:
    return SplitSizes({"train": train, "extra": extra, "val": val, "test": test}, tasks, unseen)


SMALL_SCALES: Mapping[str, SplitSizes] = {
    "maxi": _small(256, 16, 4, 20, 25_600, 500),
    "midi": _small(128, 8, 4, 20, 12_800, 500),
    "mini": _small(24, 8, 4, 20, 2_400, 500),
    "tiny": _small(2, 1, 1, 1, 20, 8),
}
"""'mini' is built in minutes and holds 500 tasks in 20 unseen houses to judge by; 'midi' has the same unseen houses and
five times the houses to learn from, with as many tasks each, and 'maxi' twice those; the first houses of a larger one
are those of the smaller; 'tiny' is for tests."""
PAPER = "paper"
"""The scale of the paper that a kind of task is from (TaskKind.paper)."""
DATASET_SCALES = (PAPER, *SMALL_SCALES)


@dataclass(frozen=True)
class DatasetSize:
    """A size of one's own; its tasks begin with those of a smaller one."""

    houses: int
    """To train in; a tenth as many to validate in."""
    tasks: int
    """Training tasks."""
    test_houses: int | None = None
    """To test in, with as many tasks each; a fifth of `houses` where not given, with a fifth of `tasks`."""
    evaluation_tasks: int | None = None
    """Tasks in every split to validate and to test in."""

    def __post_init__(self) -> None:
        given = (self.houses, self.tasks, self.test_houses, self.evaluation_tasks)
        if any(n is not None and n < 1 for n in given):
            raise ValueError(
                "a data set needs at least one house, one task, one house to test in and one task to evaluate in, got "
                "{}, {}, {} and {}".format(*given)
            )

    def __str__(self) -> str:
        """As files of data sets have it: '40x4000x60/400'."""
        optional = (("x", self.test_houses), ("/", self.evaluation_tasks))
        return f"{self.houses}x{self.tasks}" + "".join(f"{mark}{n}" for mark, n in optional if n is not None)

    @classmethod
    def of(cls, text: str) -> DatasetSize:
        """The size that a file of a data set has.

        Raises:
          ValueError: it is none.
        """
        sizes, slash, each = text.partition("/")
        houses, tasks, *test = (int(n) for n in sizes.split("x"))
        (test_houses,) = test or (None,)
        return cls(houses, tasks, test_houses, int(each) if slash else None)

    @property
    def sizes(self) -> SplitSizes:
        """Numbers that its splits are made of."""
        n, test = self.houses, self.test_houses or max(1, self.houses // 5)
        unseen = max(2, round(self.tasks / n * test) if self.test_houses else self.tasks // 5)
        houses = {"train": n, "extra": max(1, n // 3), "val": max(1, n // 10), "test": test}
        return SplitSizes(houses, self.tasks, unseen, self.evaluation_tasks)


def described(name: str) -> str:
    """A scale in words: '24 + 4 + 20 houses, 2,400 tasks'."""
    if name == PAPER:
        return "as many as in the paper of the kind of task"
    sizes = SMALL_SCALES[name]
    return f"{' + '.join(str(sizes.houses[g]) for g in ('train', 'val', 'test'))} houses, {sizes.tasks:,} tasks"
