"""Settings of the sampler, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass

from mofit.errors import Fault, raise_errors


@dataclass(frozen=True)
class SampleSettings:
    """Settings of `sample_mode`."""

    ensembles: int = 4
    """Independent ensembles: R-hat between fewer than 4 chains is unreliable (Vehtari et al. 2021)."""
    walkers: int = 32
    """Walkers per ensemble, at least: half of them fills 16 lanes of the kernel. Doubled until they are twice the
    number of parameters, which emcee's moves need."""
    chunk: int = 25
    """Fewest steps between two checks of convergence (and two checkpoints); grows to a tenth of the chain."""
    max_steps: int = 5000
    """Production steps per ensemble after which the chain is handed over unconverged."""
    round_steps: int = 12
    """Steps of one round of burn-in, after which the Student-t proposal is adapted."""
    min_rounds: int = 3
    """The proposal comes from the Laplace approximation in round 1 and from truly moved walkers from round 3 on."""
    max_rounds: int = 40
    """480 steps; whatever still drifts then shows in R-hat."""
    tau_multiple: float = 50.0
    """Autocorrelation times a chain must hold before its estimate of tau is trusted (emcee's documentation)."""
    tau_change: float = 0.1
    """Largest relative change of tau between two checks: about its own standard error at 50 tau and 32 walkers."""
    max_r_hat: float = 1.01
    """Vehtari et al. (2021)."""
    min_ess: float = 1000.0
    """Effective draws per parameter: 95 % intervals known to about a tenth of a standard deviation."""
    max_strays: float = 0.05
    """Largest share of walkers that stuck or left for another mode; past it the mode does not stand on its own."""
    freedom: float = 5.0
    """Degrees of freedom of the Student-t proposal: heavy tails, yet 67 % accepted on a Gaussian in 9 dimensions."""
    student: float = 0.85
    """Share of steps that use the independent Student-t proposal, the fast one on near-Gaussian posteriors."""
    differential: float = 0.1
    """Share of differential-evolution steps (Nelson et al. 2014), for shapes that no Student-t fits."""
    stretch: float = 0.025
    """Share of stretch steps (Goodman, Weare 2010): they reach along ridges."""
    snooker: float = 0.025
    """Share of snooker steps (Ter Braak, Vrugt 2008): long ones between other walkers."""

    def __post_init__(self) -> None:
        shares = (self.student, self.differential, self.stretch, self.snooker)
        checks = [
            ("ensembles", self.ensembles >= 2, "Give at least 2, better 4"),
            ("walkers", self.walkers >= 8 and self.walkers % 2 == 0, "Give an even number of at least 8"),
            ("chunk", self.chunk >= 1, "Give at least 1"),
            ("max_steps", self.max_steps >= 1, "Give at least 1"),
            ("round_steps", self.round_steps >= 2, "Give at least 2"),
            ("max_rounds", self.max_rounds >= self.min_rounds >= 1, "Give at least min_rounds, and that at least 1"),
            ("freedom", self.freedom > 0, "Give a positive number"),
            (
                "student",
                min(shares) >= 0 and sum(shares) > 0,
                "Give shares of which none is negative and not all are 0",
            ),
        ]
        raise_errors(
            Fault(f"sampler setting '{name}'", f"{getattr(self, name)!r} cannot be used", cure)
            for name, fine, cure in checks
            if not fine
        )

    def walkers_for(self, dimension: int) -> int:
        """Walkers per ensemble for d parameters: doubled until they are at least 2 d."""
        walkers = self.walkers
        while walkers < 2 * dimension:
            walkers *= 2
        return walkers
