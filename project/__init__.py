"""Read, check and write the project file, and build the objects that it describes."""
