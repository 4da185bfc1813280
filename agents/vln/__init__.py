"""VLN: followers of route instructions (dissertation 2.2; Room-to-Room)."""
