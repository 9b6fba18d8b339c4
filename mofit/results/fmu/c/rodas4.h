/* Integration over a communication step: RODAS4 with control of the error.
 *
 * Copyright (c) the mofit developers. MIT licence, see documentation/licenses.
 */
#ifndef RODAS4_H
#define RODAS4_H

#include "memory.h"

/* LU factors of a matrix, stored by columns, in place with partial pivoting; 0 if it is singular */
static int factorise(double* a, int* pivot) {
  int i, j, k;
  for (k = 0; k < STATES; k++) {
    pivot[k] = k;
    for (i = k + 1; i < STATES; i++)
      if (fabs(a[i + k * STATES]) > fabs(a[pivot[k] + k * STATES])) pivot[k] = i;
    if (!(fabs(a[pivot[k] + k * STATES]) > 0)) return 0;
    for (j = 0; j < STATES; j++) {
      const double kept = a[k + j * STATES];
      a[k + j * STATES] = a[pivot[k] + j * STATES];
      a[pivot[k] + j * STATES] = kept;
    }
    for (i = k + 1; i < STATES; i++) {
      a[i + k * STATES] /= a[k + k * STATES];
      for (j = k + 1; j < STATES; j++) a[i + j * STATES] -= a[i + k * STATES] * a[k + j * STATES];
    }
  }
  return 1;
}

static void solve(const double* a, const int* pivot, double* b) {
  int i, k;
  for (k = 0; k < STATES; k++) {
    const double kept = b[k];
    b[k] = b[pivot[k]];
    b[pivot[k]] = kept;
  }
  for (k = 0; k < STATES; k++)
    for (i = k + 1; i < STATES; i++) b[i] -= a[i + k * STATES] * b[k];
  for (k = STATES - 1; k >= 0; k--) {
    b[k] /= a[k + k * STATES];
    for (i = 0; i < k; i++) b[i] -= a[i + k * STATES] * b[k];
  }
}

/* RODAS4, an L-stable Rosenbrock method of order 4 with an embedded one of order 3: Hairer & Wanner, Solving Ordinary
 * Differential Equations II, 2nd ed., section VI.4. The last stage is the difference of the two. */
#define STAGES 6
static const double gamma_ = 0.25;
static const double A[STAGES][STAGES] = {
    {0},
    {1.544},
    {0.9466785280815826, 0.2557011698983284},
    {3.314825187068521, 2.896124015972201, 0.9986419139977817},
    {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950},
    {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 1.0}};
static const double C[STAGES][STAGES] = {
    {0},
    {-5.6688},
    {-2.430093356833875, -0.2063599157091915},
    {-0.1073529058151375, -9.594562251023355, -20.47028614809616},
    {7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160},
    {8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054}};
static const double NODE[STAGES] = {0.0, 0.386, 0.21, 0.63, 1.0, 1.0};
static const double D[STAGES] = {0.25, -0.1043, 0.1035, -0.0362, 0.0, 0.0};

/* One step from the state at `since`; returns the error in units of the tolerance, not finite if it failed. */
static double rosenbrock(const Memory* m, double since, double h, double* next) {
  double f[SIZE(STATES)], jacobian[SIZE(STATES * STATES)], drift[SIZE(STATES)], stage[STAGES][SIZE(STATES)];
  double at[SIZE(STATES)], error = 0;
  int pivot[SIZE(STATES)], i, j, k;
  linearised(m, m->x, f, jacobian, drift, since);
  for (k = 0; k < STATES * STATES; k++) jacobian[k] = -jacobian[k];
  for (k = 0; k < STATES; k++) jacobian[k + k * STATES] += 1 / (gamma_ * h);
  if (!factorise(jacobian, pivot)) return HUGE_VAL;
  for (i = 0; i < STAGES; i++) {
    for (k = 0; k < STATES; k++) {
      at[k] = m->x[k];
      for (j = 0; j < i; j++) at[k] += A[i][j] * stage[j][k];
    }
    if (i > 0) slope(m, since + NODE[i] * h, at, f);
    for (k = 0; k < STATES; k++) {
      double memory = 0;
      for (j = 0; j < i; j++) memory += C[i][j] * stage[j][k];
      stage[i][k] = f[k] + memory / h + D[i] * h * drift[k];
    }
    solve(jacobian, pivot, stage[i]);
  }
  for (k = 0; k < STATES; k++) {
    const double size = fmax(model_nominal[k], fmax(fabs(m->x[k]), fabs(at[k])));
    const double own = fabs(stage[STAGES - 1][k]) / (m->tolerance * size);
    next[k] = at[k] + stage[STAGES - 1][k];
    if (!isfinite(own) || !isfinite(next[k])) return HUGE_VAL;
    error = fmax(error, own);
  }
  return error;
}

/* The state at the end of a communication step; 0 if the integrator gives up. */
static int integrate(Memory* m, double length) {
  double since = 0, next[SIZE(STATES)];
  int tries;
  if (!(m->step > 0)) m->step = length;
  for (tries = 0; tries < MOST_STEPS; tries++) {
    const double left = length - since;
    const int last = m->step >= left * (1 - 1e-12);
    const double h = last ? left : m->step;
    const double error = rosenbrock(m, since, h, next);
    const double factor = isfinite(error) ? fmin(5, fmax(0.2, 0.9 * pow(error + 1e-10, -0.25))) : 0.2;
    if (error <= 1) {
      memcpy(m->x, next, sizeof m->x);
      since += h;
      m->step = last ? fmax(m->step, h * factor) : h * factor; /* a step cut short says little */
      if (last) return 1;
    } else {
      m->step = h * fmin(factor, 0.9);
      if (!(m->step > 1e-14 * length)) return 0;
    }
  }
  return 0;
}

#endif
