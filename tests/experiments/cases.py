"""A kind of test as a plug-in writes it."""

KIND = """
class Kind:
    name, title, section, fitted = "acme", "an acme test", None, True
    predicted = studied = read = report = None

THING = Kind()
"""
