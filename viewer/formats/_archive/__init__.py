"""Archives of named arrays (pickles, ``.npz``, ``.npy``): opening, values and checks."""
