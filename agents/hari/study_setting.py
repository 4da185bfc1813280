"""What all runs of HARI's study share, where they lie, and what was judged of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from agents.hari.config import ExecutionConfig, IntentionConfig
from embodied.evaluation.tables import Estimate, across_seeds
from embodied.records import parse_file


@dataclass(frozen=True)
class HariStudySetting:
    """What all runs of a study share."""

    data: Path
    out: Path
    execution: ExecutionConfig
    intention: IntentionConfig
    """Its seed is the first one."""
    executor: Path | None = None
    """A trained execution policy; None trains one into the study's folder."""
    seeds: int = 3
    """Intention policies of each variant; of the table 'sight', execution policies."""
    tasks: int | None = None
    """Judge on at most so many tasks of a split."""
    threads: int = 1
    """Of PyTorch, per run."""
    encoder: str = ""
    """Digest of the encoder whose features a policy sees."""
    quality: str | None = None
    """Of the pictures that they come from, as in agents.vision.run.pictures_of."""

    @property
    def repeats(self) -> list[int]:
        return [self.intention.seed + k for k in range(self.seeds)]

    def folder(self, variant: str, seed: int) -> Path:
        return self.out / variant.replace(" ", "_").replace(",", "") / f"seed_{seed}"


def rows_of(setting: HariStudySetting, variant: str, row: str, split: str) -> list[dict[str, float]]:
    """The means of one row of what was judged of a variant on one split, per seed."""
    found = []
    for seed in setting.repeats:
        path = setting.folder(variant, seed) / "rows.json"
        try:
            (mine,) = [r for r in parse_file(path) if r["agent"] == row and r["split"] == split]  # type: ignore[attr-defined]
            found.append({k: v["mean"] for k, v in mine["values"].items()})
        except (KeyError, TypeError, AttributeError, ValueError) as e:
            raise ValueError(f"{path} is no table of this study ({e!r}); delete it, the same command makes it") from e
    return found


def estimates(setting: HariStudySetting, variant: str, split: str, column: str, row: str = "learned") -> Estimate:
    """A number of a row over seeds, with Student's interval."""
    return across_seeds([r[column] for r in rows_of(setting, variant, row, split)])
