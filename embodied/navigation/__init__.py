"""Places to stand and to walk: free space and the navigation graph."""
