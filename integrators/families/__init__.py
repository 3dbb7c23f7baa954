"""Families of methods: what each declares, and how its step is written."""
