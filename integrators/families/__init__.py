"""Families of integration methods: classes that know the properties of their methods and write their steps."""
