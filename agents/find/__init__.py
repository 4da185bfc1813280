"""Finding an object without help (Find-v0): a learned agent on features, and explorers to compare with."""
