"""The one study engine: tables are data, a learner is a protocol."""
