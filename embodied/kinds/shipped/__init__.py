"""The kinds of tasks that come with the program, a file each, which begins with the kind's title."""
