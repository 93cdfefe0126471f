"""Any program that the site allows, started by a command on a deck of the user's own."""
