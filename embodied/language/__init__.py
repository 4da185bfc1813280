"""What people say: requests, routes, sub-goals."""
