"""VLN: followers of route instructions, and a speaker that describes walks (dissertation 2.2; Room-to-Room)."""
