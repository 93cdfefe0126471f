"""Export material cards to other programs; see docs/how-to/exports.md."""
