"""Questions about houses with exact answers: walks, questions, blind models that thin them, and formats."""
