"""REGEX: changing words as a request says, by a regular expression (3.2.4.3)."""
