"""Rerun recordings, plots and reports. Rerun lives here and only here."""
