"""Families of integration methods: one class per family states a method's properties and writes its step."""
