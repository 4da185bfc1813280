"""Teachers: see everything, label training data, never speak to the agent."""
