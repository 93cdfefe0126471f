"""A fit as a whole: project, settings, output folder, result; and predictions with its card."""
