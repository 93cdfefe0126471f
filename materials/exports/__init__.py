"""Material cards for other programs: one module a format; see docs/exports.md."""
