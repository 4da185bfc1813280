"""Export a data set or a house to the formats of other programs."""

from embodied.cli.exports import registered_exports

COMMANDS = registered_exports()
