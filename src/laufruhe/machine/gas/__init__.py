"""Models of the working gas, a file for each."""
