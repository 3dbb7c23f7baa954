"""How a scene is run: scene and method become one step function, interpreted or compiled."""
