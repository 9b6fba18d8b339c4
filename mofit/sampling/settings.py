"""Settings of the sampler, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass

from mofit.errors import check_settings


@dataclass(frozen=True)
class SampleSettings:
    """Settings of `sample_mode`."""

    ensembles: int = 4
    """Independent ensembles."""
    least_ensembles: int = 4
    """R-hat between fewer is unreliable (Vehtari et al. 2021): they are never called converged."""
    walkers: int = 24
    """Walkers per ensemble: differences within a half span a dozen dimensions. Doubled until they are twice the number
    of parameters, which emcee's moves need."""
    chunk: int = 10
    """Fewest steps between two checks of convergence (and two checkpoints); grows to a twentieth of the chain."""
    max_steps: int = 6000
    """Production steps per ensemble after which sampling ends unconverged: what mixes more slowly than in 60 steps is a
    ridge or several modes, which more steps do not mend."""
    refit_steps: int = 100
    """Production steps before the proposal may be fitted again; twice as many each time."""
    most_refits: int = 4
    """Such fits at most: a shape that the fifth mixture does not follow is none for mixtures."""
    slower: float = 2.0
    """Factor between the autocorrelation time that a proposal promises, 3 steps at most, and the one it leaves that is
    no reason to fit it again."""
    fewest_steps: int = 400
    """Steps before a chain is given up whose autocorrelation time shows that the most steps would not do."""
    growth: float = 1.7
    """The same from twice as many steps on where the autocorrelation time has grown so much since the last check, when
    the chain was half as long, and would be too long if it grew as much once more: that of a chain which mixes settles
    within some twenty of it."""
    round_steps: int = 12
    """Fewest steps of one round of burn-in, after which the independent proposal is adapted."""
    min_rounds: int = 5
    """Some 3,000 positions to fit the proposal to, in the later half: the fit costs less than it saves."""
    max_rounds: int = 14
    """About 800 steps; whatever still drifts then shows in R-hat."""
    settled_errors: float = 4.0
    """Burn-in may end when the mean log posteriors of two rounds agree within so many standard errors: the errors count
    steps as independent, so that two would be too strict."""
    settled_times: float = 10.0
    """Autocorrelation times that burn-in lasts at least: the start decays to e^-10."""
    outlier_deviations: float = 8.0
    """Robust standard deviations past which a walker is an outlier at the end of burn-in: no sample of an exponential
    tail reaches it."""
    tau_multiple: float = 100.0
    """Autocorrelation times that every ensemble must hold (emcee's tutorial on convergence)."""
    tau_growth: float = 0.01
    """Largest relative growth of any parameter's tau between two checks (ibid.): while it grows, the chain is too short
    to show it; one that falls asks for no longer chain."""
    max_r_hat: float = 1.01
    """Vehtari et al. (2021)."""
    min_ess: float = 1000.0
    """Effective draws per parameter: 95 % intervals known to about a tenth of a standard deviation."""
    left: tuple[float, float, float] = (6.0, 1.5, 3.0)
    """A walker has left for another mode if its mean is off by six standard errors, by one and a half typical standard
    deviations, and by three of its own: see `mofit.sampling.convergence.stuck_walkers`."""
    max_stuck: float = 0.05
    """Largest share of walkers that are stuck or have left; past it the mode is not separate from others."""
    independence: float = 0.85
    """Share of steps that use the independence proposal, the fast one where it fits."""
    tolerated_time: float = 2.0
    """Predicted autocorrelation time past which that share falls: where the proposal fits badly, local moves free the
    walkers that stick."""
    fitted_draws: int = 4096
    """Draws that the independence proposal is fitted to, at most: plenty for 16 components."""
    differential: float = 0.1
    """Share of differential-evolution steps (Nelson et al. 2014), for shapes that no Student-t fits."""
    stretch: float = 0.025
    """Share of stretch steps (Goodman, Weare 2010): they reach along narrow directions."""
    snooker: float = 0.025
    """Share of snooker steps (Ter Braak, Vrugt 2008): long ones between other walkers."""
    checkpoint_seconds: float = 1.0
    """Least time between two checkpoints: with quick posteriors, writing would take longer than sampling."""

    def __post_init__(self) -> None:
        shares = (self.independence, self.differential, self.stretch, self.snooker)
        checks = [
            ("ensembles", self.ensembles >= 2, "Give at least 4; 2 for a trial that will not be called converged"),
            ("walkers", self.walkers >= 8 and self.walkers % 2 == 0, "Give an even number of at least 8"),
            ("chunk", self.chunk >= 1, "Give at least 1"),
            ("max_steps", self.max_steps >= 1, "Give at least 1"),
            ("round_steps", self.round_steps >= 2, "Give at least 2"),
            ("max_rounds", self.max_rounds >= self.min_rounds >= 1, "Give at least min_rounds, and that at least 1"),
            (
                "independence",
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
