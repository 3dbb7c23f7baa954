"""The simulation engine: it turns a scene and a method into one step function, interpreted or compiled."""
