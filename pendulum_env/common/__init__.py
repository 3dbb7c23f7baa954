"""What every room may use and that knows nothing of pendulums: files, warnings, progress, tables of text."""
