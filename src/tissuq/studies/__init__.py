"""What the commands do: the settings of each, read from options or a file, its work, and the result."""
