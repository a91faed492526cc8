// The Riccati recursion of the finite-horizon tracker.
#pragma once

namespace pilotfish {

// Row-major stacks. A and B hold one matrix, or T - 1 of them.
struct Tracking {
  long T;
  int n, m;
  bool varying;
  const double *A, *B, *weights, *targets, *control_cost;
};

struct Gains {
  double *gains, *feedforwards, *values, *gradients;
};

// Returns -1, or the step at which effort + B^T P B has no Cholesky factor.
long riccati(Tracking problem, Gains result);

}  // namespace pilotfish
