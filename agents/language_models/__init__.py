"""Language models as agents, assistants, paraphrasers and judges, through any server that speaks OpenAI's protocol."""
