"""Project files: what a fit is asked to do, read, checked and converted to mm, N, MPa."""
