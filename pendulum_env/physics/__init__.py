"""What is simulated: the apparatus, the medium, the effects and the scenes made of them. Plain Python on floats."""
