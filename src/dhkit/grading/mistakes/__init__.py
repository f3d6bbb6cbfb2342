"""Where students go wrong: a library of mistakes, what each changes on a robot, and which one gives an answer."""
