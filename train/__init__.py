"""The networks of the paper, their training, and the finishing that makes valid charts of them."""
