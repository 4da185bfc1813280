"""VNLA: an agent that learns when to ask an advisor and to do what it says (dissertation 4.1)."""
