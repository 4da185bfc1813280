"""Where one can stand and walk: free space and the navigation graph."""
