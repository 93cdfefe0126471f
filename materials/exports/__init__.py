"""Material cards for other programs: one module a format; see docs/how-to/exports.md."""
