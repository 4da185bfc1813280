"""The name of our distribution."""

DISTRIBUTION = "embodied-houses"
"""The distribution's name for pip; `embodied` on PyPI is another project's."""
