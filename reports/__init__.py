"""Presentation of results: charts, report pages, and files for ParaView."""
