"""From a project to a fit ready to run, and from finished starts to results and pages."""
