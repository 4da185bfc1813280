"""A person in the browser, in every role: assistant, agent, rater, describer. The web server lives here only."""
