"""Charts, the page and files for ParaView; presenters of fits, predictions and studies."""
