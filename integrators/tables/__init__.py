"""Coefficients of the methods, family by family: nothing but data."""
