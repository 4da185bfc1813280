"""ILIAD: learning from descriptions of what one did (dissertation 3.2, appendix C), in words and in houses."""
