"""Ask-v0's learned asker: imitation of an oracle that knows what each answer would save."""
