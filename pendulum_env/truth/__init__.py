"""Reference solutions: closed forms, and numerical solutions independent of the methods that are compared with them."""
