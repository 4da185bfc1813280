"""BANDITNMT: learning from ratings by advantage actor-critic (dissertation 3.1), translations and walks alike."""
