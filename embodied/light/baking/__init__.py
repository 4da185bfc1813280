"""From a house to its lit pages: light at every luxel, smoothed, composed, checked and written."""
