"""The continuous tasks that come with the program, a file each, which begins with the task's title."""
