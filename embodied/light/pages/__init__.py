"""The store of light: surfaces laid out flat, pages of texels, their colours and exposure, and their files."""
