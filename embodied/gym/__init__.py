"""The environments as Gymnasium knows them."""
