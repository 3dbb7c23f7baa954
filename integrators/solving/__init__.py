"""Solution of problems with a method: ``solve``, ``solve_first_order``, step-size control, events, dense output.

A run is one loop over steps, whatever is asked for. A march takes the steps: ``equal.EqualSteps``, or
``adaptive.March`` under a tolerance, where ``max_step`` bounds each. Where anything is wanted between the ends of
steps, ``dense.Recorder`` makes a curve of each step. ``events.Watch`` looks at each curve, and interrupts the march at
an event that ends the solution or has an action; ``solve`` then lets the same march go on from the state after the
action. Dense output and ``t_eval`` are read off the curves at the end. ``first_order`` puts y' = f(t, y) into the form
of the others.
"""
