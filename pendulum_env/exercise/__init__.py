"""The lab exercise."""
