"""The spec: the parameters of a robot that training needs besides its description."""
