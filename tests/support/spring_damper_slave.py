"""A spring and damper in parallel as PythonFMU takes it; the test packs it into an FMU."""

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class SpringDamper(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.k, self.d = 1000.0, 50.0
        self.displacement = self.velocity = self.force = 0.0
        for name in ("k", "d"):
            self.register_variable(Real(name, causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))
        for name in ("displacement", "velocity"):
            self.register_variable(Real(name, causality=Fmi2Causality.input))
        self.register_variable(Real("force", causality=Fmi2Causality.output))

    def exit_initialization_mode(self):
        self.do_step(0.0, 0.0)

    def do_step(self, current_time, step_size):
        self.force = self.k * self.displacement + self.d * self.velocity
        return True
