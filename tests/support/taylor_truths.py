"""What Taylor series must be, from outside the package: their stability function is exp's series cut off."""

# The least positive roots of |sum_(k<=12) (iz)^k/k!| = 1 and of |sum_(k<=12) (-x)^k/k!| = 1, by bisection in 50 digits.
LIMITS = (3.3793773141571255, 5.8227790681937215)
