"""Things built in code: furniture and small objects that the asset packs lack."""
