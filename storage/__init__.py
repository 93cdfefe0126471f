"""Files and folders: reading, writing, templates, plain values, where things lie."""
