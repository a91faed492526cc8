// Riccati recursion of finite-horizon linear-quadratic tracking. Defined by kernels/reference/riccati.py.
#pragma once

namespace pilotfish {

// Problem in row-major arrays. A and B have one matrix, or T - 1 if varying.
struct Tracking {
  long T;
  int n, m;
  bool varying;
  const double *A, *B, *weights, *targets, *control_cost;
};

struct Gains {
  double *gains, *feedforwards, *values, *gradients;
};

// Returns -1, or the step at which control_cost + B^T P B has no Cholesky factor.
long riccati(Tracking problem, Gains result);

}  // namespace pilotfish
