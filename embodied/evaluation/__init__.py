"""Playing and judging: rollouts, metrics, tables."""
