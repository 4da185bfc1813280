"""How large a data set is: houses and tasks per split, as in Tables 4.2 and E.1 or smaller."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

KINDS = ("find", "vln", "vnla", "hanna", "hari")


@dataclass(frozen=True)
class SplitPlan:
    """One split: which houses it draws from and how many tasks it wants."""

    name: str
    group: str
    """The group of houses: 'train', 'extra', 'val', 'test' or 'ood'. A 'seen' split shares 'train'."""
    tasks: int
    part: str = "main"
    """Which part of each house's pool: 'main', 'val' or 'test' (held out), 'pretrain', 'pretrain_val',
    'start_val', 'start_test', 'object_val', 'object_test' (HARI)."""
    groups: tuple[str, ...] = ()
    """More groups it draws from, besides `group`."""

    @property
    def all_groups(self) -> tuple[str, ...]:
        return (self.group, *self.groups)


@dataclass(frozen=True)
class Scale:
    name: str
    houses: Mapping[str, int]
    """Group to number of houses."""
    splits: tuple[SplitPlan, ...]


def _seen_and_unseen(
    train: int, val_seen: int, val_unseen: int, test_seen: int, test_unseen: int
) -> tuple[SplitPlan, ...]:
    return (
        SplitPlan("train", "train", train),
        SplitPlan("val_seen", "train", val_seen, "val"),
        SplitPlan("val_unseen", "val", val_unseen),
        SplitPlan("test_seen", "train", test_seen, "test"),
        SplitPlan("test_unseen", "test", test_unseen),
    )


def _hari(sizes: tuple[int, int, int, tuple[int, int, int], tuple[int, int, int]]) -> tuple[SplitPlan, ...]:
    pretrain, pretrain_val, train, val, test = sizes
    splits = [
        SplitPlan("pretrain", "train", pretrain, "pretrain"),
        SplitPlan("pretrain_val", "train", pretrain_val, "pretrain_val"),
        SplitPlan("train", "train", train, groups=("extra",)),
    ]
    for when, (start, other, env) in (("val", val), ("test", test)):
        splits += [
            SplitPlan(f"{when}_unseen_start", "train", start, f"start_{when}", ("extra",)),
            SplitPlan(f"{when}_unseen_object", "train", other, f"object_{when}", ("extra",)),
            SplitPlan(f"{when}_unseen_env", when, env),
        ]
    return tuple(splits)


TABLE_4_2 = {"train": 51, "val": 7, "test": 10}, _seen_and_unseen(82_484, 5_001, 5_017, 5_004, 5_012)
"""HANNA, dissertation Table 4.2."""
TABLE_E_1 = (
    {"train": 36, "extra": 18, "val": 7, "test": 11},
    _hari((82_104, 3_000, 65_133, (1_901, 1_912, 1_967), (1_653, 1_913, 1_777))),
)
"""HARI, dissertation Table E.1. It names 36 houses for pre-training and 18 more for training; the
seen conditions draw from all 54."""
ROOM_TO_ROOM = {"train": 61, "val": 11, "test": 18}, _seen_and_unseen(14_025, 1_020, 2_349, 1_020, 4_173)
"""VLN, which the dissertation does not tabulate: Anderson et al. 2018, section 4.4 (61 scenes with 14,025
training and 1,020 seen validation instructions, 11 scenes with 2,349, 18 scenes with 4,173; the files that
were published later hold 14,039 and 1,021). Room-to-Room has no seen test split; ours has one of the size
of its seen validation split."""

PAPER: Mapping[str, tuple[Mapping[str, int], tuple[SplitPlan, ...]]] = {
    "hanna": TABLE_4_2,
    "hari": TABLE_E_1,
    "vln": ROOM_TO_ROOM,
    "vnla": TABLE_4_2,
    "find": TABLE_4_2,
}
"""VNLA's own sizes are not printed in the dissertation; it gets HANNA's."""


def _small(
    kind: str, houses: tuple[int, int, int, int], tasks: int, judged: int, each: int | None = None
) -> tuple[Mapping[str, int], tuple[SplitPlan, ...]]:
    """
    Args:
      judged: tasks in unseen houses; the other splits to evaluate in have a half or, HARI's, a third as many.
      each: instead, tasks of every split to evaluate in.
    """
    train, extra, val, test = houses
    judged = each or judged
    if kind == "hari":
        third = each or max(1, judged // 3)
        sizes = (tasks, max(1, tasks // 10), tasks, (third, third, third), (third, third, judged))
        return {"train": train, "extra": extra, "val": val, "test": test}, _hari(sizes)
    held = each or max(1, judged // 2)
    return {"train": train, "val": val, "test": test}, _seen_and_unseen(tasks, held, held, held, judged)


SMALL: Mapping[str, tuple[tuple[int, int, int, int], int, int]] = {
    "maxi": ((256, 16, 4, 20), 25_600, 500),
    "midi": ((128, 8, 4, 20), 12_800, 500),
    "mini": ((24, 8, 4, 20), 2_400, 500),
    "tiny": ((2, 1, 1, 1), 20, 8),
}
"""Houses to learn from, extra ones (HARI), to validate and to test in; training tasks; tasks in unseen houses."""
SCALES = ("paper", *SMALL)
OOD = "test_ood"
"""The split of houses out of distribution: models, looks, speakers and words that occur in no other split."""
OWN_SIZE = re.compile(r"([1-9]\d*)x([1-9]\d*)(?:x([1-9]\d*))?(?:/([1-9]\d*))?")


def own_size(houses: int, tasks: int, test: int | None = None, evaluation: int | None = None) -> str:
    """The name of a scale with so many training houses and tasks, '40x4000', and, if that is said, so many houses to
    test in, '40x4000x60', and tasks in every split to evaluate in, '40x4000x60/400'.

    Raises:
      ValueError: less than one of any.
    """
    if any(n is not None and n < 1 for n in (houses, tasks, test, evaluation)):
        raise ValueError(
            "a data set needs at least one house, one task, one house to test in and one task to evaluate in, got "
            f"{houses}, {tasks}, {test} and {evaluation}"
        )
    return f"{houses}x{tasks}" + ("" if test is None else f"x{test}") + ("" if evaluation is None else f"/{evaluation}")


def scale(name: str, kind: str, ood: int = 0) -> Scale:
    """The named scale of a kind of play, with `ood` more houses out of distribution to test in (split 'test_ood').

    'paper' has the sizes of the dissertation; 'mini' is built in minutes and holds 500 tasks in
    20 unseen houses to judge by; 'midi' has the same unseen houses and five times the houses to
    learn from, with as many tasks each, and 'maxi' twice those; the first houses of a larger one
    are those of the smaller; 'tiny' is for tests. '40x4000' has 40 houses and 4,000 tasks to learn
    from, a tenth as many houses to validate in, a fifth as many to test in and a fifth as many
    tasks there; '40x4000x60' has 60 to test in, with as many tasks each, and '40x4000x60/400' has 400 tasks in every
    split to evaluate in; its tasks begin with those of the former. Houses out of distribution
    have as many tasks each as the others to test in.

    Raises:
      ValueError: an unknown scale or kind, or a negative number of houses.
    """
    if ood < 0:
        raise ValueError(f"the number of houses out of distribution should not be negative, got {ood}")
    if kind not in KINDS:
        raise ValueError(f"unknown kind of task {kind!r}; use one of {KINDS}")
    if own := OWN_SIZE.fullmatch(name):
        n, tasks = int(own[1]), int(own[2])
        test = int(own[3]) if own[3] else max(1, n // 5)
        judged = max(2, round(tasks / n * test) if own[3] else tasks // 5)
        each = int(own[4]) if own[4] else None
        houses, splits = _small(kind, (n, max(1, n // 3), max(1, n // 10), test), tasks, judged, each)
    elif name == "paper":
        houses, splits = PAPER[kind]
    elif name in SMALL:
        houses, splits = _small(kind, *SMALL[name])
    else:
        raise ValueError(f"unknown scale {name!r}; use one of {SCALES}, or a size such as '40x4000' (houses x tasks)")
    if ood:
        unseen = next(s for s in splits if s.group == "test")
        more = SplitPlan(OOD, "ood", round(unseen.tasks / houses["test"] * ood))
        houses, splits = {**houses, "ood": ood}, (*splits, more)
    return Scale(name, dict(houses), splits)


def described(name: str, kind: str = "hanna") -> str:
    """A scale in words: '24 + 4 + 20 houses, 2,400 tasks'."""
    about = scale(name, kind)
    houses = " + ".join(str(about.houses[g]) for g in ("train", "val", "test"))
    return f"{houses} houses, {about.splits[0].tasks:,} tasks"


def quota(total: int, houses: int, index: int) -> int:
    """How many of `total` tasks the house number `index` of `houses` gives: an even share."""
    return total // houses + (index < total % houses)
