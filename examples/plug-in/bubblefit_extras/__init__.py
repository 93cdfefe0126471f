"""An example of each thing that a distribution can add to bubblefit."""
