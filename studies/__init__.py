"""What a model's answer depends on beside the material: refinement, order, parameters."""
