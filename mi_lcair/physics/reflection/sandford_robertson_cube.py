"""placeholder until the search part is merged"""

from mi_lcair.physics.reflection.interface import Parameter, ReflectionModel, Restriction


class SandfordRobertsonCube(ReflectionModel):
    name = "sandford_robertson"
    title = "Sandford-Robertson"
    parameters = (
        Parameter("epsilon", r"$\varepsilon$", "emissivity parameter", 0, 1),
        Parameter("rho_d", r"$\rho_d$", "diffuse reflectance parameter", 0, 1),
        Parameter("b", r"$b$", "grazing-angle parameter", 0, 1),
        Parameter("e", r"$e$", "width of the specular lobe", 1e-5, 1),
    )
    forms = ("thesis", "normalized")
    reciprocal = False
    restrictions = (Restriction("rho_d = 0", 1), Restriction("b = 0", 2))

    def from_cube(self, u): ...
    def to_cube(self, values): ...
    def feasible_range(self, values): ...
    def starting_points(self, count, seed): ...
