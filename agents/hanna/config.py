"""HannaSizes: the sizes of the networks. Free of torch, so that the command line answers at once."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class HannaSizes:
    """Sizes of Table D.1 and the ablations of Table D.2 (alpha = 0 is an option of training)."""

    words: int
    """Vocabulary size; word 0 is padding."""
    feature_size: int = 2048
    """D, what the visual encoder gives per view."""
    hidden_size: int = 256
    navigation_embedding: int = 256
    ask_embedding: int = 128
    self_heads: int = 8
    text_heads: int = 8
    dropout: float = 0.3
    orientation_copies: int = 32
    """How often each of the four orientation features is repeated."""
    reset_inter_task: bool = True
    """False: ablation 'no inter-task reset'."""
    predict_reasons: bool = True
    """False: ablation 'no condition prediction': the request is read off the state directly."""
    similarity_attention: bool = True
    """False: ablation 'no cosine-similarity attention' (beta = 0)."""

    def __post_init__(self) -> None:
        for name in ("words", "feature_size", "hidden_size", "navigation_embedding", "ask_embedding"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)}")
        if not 0 <= self.dropout < 1:
            raise ValueError(f"dropout must be in [0, 1), got {self.dropout}")

    @property
    def action_size(self) -> int:
        """E, length of a navigation action's embedding (D.1)."""
        return self.feature_size + 4 * self.orientation_copies
