"""The learners that come with the program: a file each, with its commands. Free of torch."""
