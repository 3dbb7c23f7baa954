"""Studies: several methods compared, what accuracy costs, which effects matter."""
