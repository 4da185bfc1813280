"""The name of our distribution."""

DISTRIBUTION = "embodied-houses"
"""What pip calls us; `embodied` on PyPI is another project's."""
