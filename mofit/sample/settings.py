"""Settings of the sampler, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass

from mofit.errors import check_settings


@dataclass(frozen=True)
class SampleSettings:
    """Settings of `sample_mode`."""

    ensembles: int = 4
    """Independent ensembles; fewer than 4 are never called converged."""
    walkers: int = 24
    """Walkers per ensemble, at least: enough to span a dozen dimensions by differences within a half. Doubled until
    they are twice the number of parameters, which emcee's moves need."""
    chunk: int = 10
    """Fewest steps between two checks of convergence (and two checkpoints); grows to a twentieth of the chain."""
    max_steps: int = 12000
    """Production steps per ensemble after which the chain is handed over unconverged."""
    round_steps: int = 12
    """Fewest steps of one round of burn-in, after which the independent proposal is adapted."""
    min_rounds: int = 5
    """Some 3,000 positions to fit the proposal to, in the later half: the fit costs less than it saves."""
    max_rounds: int = 14
    """About 800 steps; whatever still drifts then shows in R-hat."""
    tau_multiple: float = 100.0
    """Autocorrelation times that every ensemble must hold (emcee's tutorial on convergence)."""
    tau_change: float = 0.01
    """Largest relative change of any parameter's tau between two checks (ibid.)."""
    max_r_hat: float = 1.01
    """Vehtari et al. (2021)."""
    min_ess: float = 1000.0
    """Effective draws per parameter: 95 % intervals known to about a tenth of a standard deviation."""
    max_strays: float = 0.05
    """Largest share of walkers that stuck or left for another mode; past it the mode does not stand on its own."""
    student: float = 0.85
    """Share of steps that use the independent proposal, the fast one where it fits."""
    patience: float = 2.0
    """Predicted autocorrelation time past which the independent proposal's share falls: where it fits badly, local
    moves beside it carry walkers out of the places where they stick."""
    fitted_draws: int = 4096
    """Draws that the independent proposal is fitted to, at most: plenty for 16 components."""
    differential: float = 0.1
    """Share of differential-evolution steps (Nelson et al. 2014), for shapes that no Student-t fits."""
    stretch: float = 0.025
    """Share of stretch steps (Goodman, Weare 2010): they reach along ridges."""
    snooker: float = 0.025
    """Share of snooker steps (Ter Braak, Vrugt 2008): long ones between other walkers."""

    def __post_init__(self) -> None:
        shares = (self.student, self.differential, self.stretch, self.snooker)
        checks = [
            ("ensembles", self.ensembles >= 2, "Give at least 4; 2 for a trial that will not be called converged"),
            ("walkers", self.walkers >= 8 and self.walkers % 2 == 0, "Give an even number of at least 8"),
            ("chunk", self.chunk >= 1, "Give at least 1"),
            ("max_steps", self.max_steps >= 1, "Give at least 1"),
            ("round_steps", self.round_steps >= 2, "Give at least 2"),
            ("max_rounds", self.max_rounds >= self.min_rounds >= 1, "Give at least min_rounds, and that at least 1"),
            (
                "student",
                min(shares) >= 0 and sum(shares) > 0,
                "Give shares of which none is negative and not all are 0",
            ),
        ]
        check_settings("sampler", self, checks)

    def walkers_for(self, dimension: int) -> int:
        """Walkers per ensemble for d parameters: doubled until they are at least 2 d."""
        walkers = self.walkers
        while walkers < 2 * dimension:
            walkers *= 2
        return walkers
